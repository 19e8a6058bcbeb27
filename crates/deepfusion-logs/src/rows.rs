//! What all readers of text share: the text, and what is said of its rows.

use crate::error::{Error, Result};
use crate::log::Speed;
use crate::note::{LogNote, TableNote};
use crate::problem::{LineProblem, SpeedProblem};
use std::path::Path;

/// A file's text: UTF-8, with a byte order mark or without.
pub(crate) fn text_of(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    String::from_utf8(bytes).map_err(|e| {
        let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = memchr::memchr_iter(b'\n', before).count() as u64 + 1;
        let utf16 = [&b"\xff\xfe"[..], b"\xfe\xff"]
            .iter()
            .any(|mark| e.as_bytes().starts_with(mark));
        Error::Line {
            path: path.to_owned(),
            line,
            field: "any".into(),
            problem: if utf16 {
                LineProblem::Utf16
            } else {
                LineProblem::NoText
            },
        }
    })
}

/// Says what of the rows was not used.
pub(crate) fn left_out(notes: &mut Vec<LogNote>, rows: usize, absent: usize, repeated: usize) {
    if absent > 0 {
        notes.push(TableNote::NoSpeed { absent, rows }.into());
    }
    if repeated > 0 {
        notes.push(TableNote::Repeated { repeated, rows }.into());
    }
}

/// A log may have one row in so many that goes back in time.
const ONE_BACK_IN: usize = 100;

/// Rows that go back in time and are left out.
#[derive(Default)]
pub(crate) struct Backwards {
    count: usize,
    first: Option<Error>,
}

impl Backwards {
    /// Leaves a row out; `error` is what is wrong with it.
    pub(crate) fn leave_out(&mut self, error: impl FnOnce() -> Error) {
        self.count += 1;
        self.first.get_or_insert_with(error);
    }

    /// What is said of them beside so many rows that are used.
    ///
    /// # Errors
    /// That of the first, where more than one row in a hundred goes back: such a log is in no order.
    pub(crate) fn note(self, used: usize) -> Result<Option<TableNote>> {
        let (back, rows) = (self.count, self.count + used);
        match self.first {
            Some(error) if back * ONE_BACK_IN > rows => Err(error),
            first => Ok(first.map(|_| TableNote::Backwards { back, rows })),
        }
    }
}

/// An error where there are not two speeds.
pub(crate) fn enough(path: &Path, speeds: &[Speed]) -> Result<()> {
    match speeds.len() {
        rows @ (0 | 1) => Err(Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::TooFewRows { rows },
        }),
        _ => Ok(()),
    }
}
