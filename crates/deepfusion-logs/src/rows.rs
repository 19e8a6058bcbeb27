//! What all readers of text share: the text, and what is said of its rows.

use crate::error::{Error, Result};
use crate::log::Speed;
use crate::problem::{LineProblem, SpeedProblem};
use deepfusion_hint::count_of;
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
pub(crate) fn left_out(notes: &mut Vec<String>, rows: usize, absent: usize, repeated: usize) {
    if absent > 0 {
        let hold = match absent {
            1 => "holds no speed and is",
            _ => "hold no speed and are",
        };
        notes.push(format!(
            "{absent} of {} {hold} left out",
            count_of(rows, "row")
        ));
    }
    if repeated > 0 {
        let repeat = match repeated {
            1 => "repeats the time of the row above and is",
            _ => "repeat the time of the row above and are",
        };
        notes.push(format!(
            "{repeated} of {} {repeat} left out",
            count_of(rows, "row")
        ));
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
