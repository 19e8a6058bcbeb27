//! Why a DBC file cannot be parsed.

use can_dbc::DbcError;

/// Why a DBC file cannot be parsed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DbcProblem {
    /// A line is not written as in a DBC file.
    #[error("line {line} is not written as in a DBC file")]
    Line {
        /// The line, counted from 1.
        line: usize,
    },
    /// Lines that can be read contradict the format. The parser does not say which.
    // No source: the message contains the parser's.
    #[error("not a valid DBC file ({0})")]
    Other(Box<DbcError>),
}

impl From<DbcError> for DbcProblem {
    fn from(error: DbcError) -> Self {
        match line_of(&error) {
            Some(line) => Self::Line { line },
            None => Self::Other(Box::new(error)),
        }
    }
}

/// The line that cannot be parsed. The parser's text begins with it, `--> 23:21`, and continues with a drawing of the line and the names of
/// its own rules.
fn line_of(error: &DbcError) -> Option<usize> {
    let DbcError::Pest(error) = error else {
        return None;
    };
    let text = error.to_string();
    let (_, place) = text.split_once("--> ")?;
    let (line, _) = place.split_once(':')?;
    line.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_is_one_short_sentence() {
        let problem = DbcProblem::from(DbcError::SignalWithoutMessage);
        assert_eq!(
            problem.to_string(),
            "not a valid DBC file (Signal defined without an associated message)"
        );
        let problem = DbcProblem::Line { line: 23 };
        assert_eq!(
            problem.to_string(),
            "line 23 is not written as in a DBC file"
        );
    }
}
