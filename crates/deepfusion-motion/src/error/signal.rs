//! Why a DBC file has no signal of a name.

/// Number of names that an error lists.
const NAMES_SHOWN: usize = 12;

/// Why a DBC file has no signal of a name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalProblem {
    /// It is no name of a signal.
    #[error("expected \"Message.Signal\"")]
    Name,
    /// There is no such message.
    #[error("no message `{message}`; there are {}", some_names(known))]
    NoMessage {
        /// The message's name.
        message: String,
        /// Those there are.
        known: Vec<String>,
    },
    /// The message has no such signal.
    #[error("`{message}` has {}", some_names(known))]
    NoSignal {
        /// The message's name.
        message: String,
        /// The signals it has.
        known: Vec<String>,
    },
}

fn some_names(names: &[String]) -> String {
    match names.split_at_checked(NAMES_SHOWN) {
        _ if names.is_empty() => "none".into(),
        Some((shown, more)) if !more.is_empty() => {
            format!("{} and {} more", shown.join(", "), more.len())
        }
        _ => names.join(", "),
    }
}
