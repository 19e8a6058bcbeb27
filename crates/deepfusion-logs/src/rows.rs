//! What all readers of text share: reading the text, and notes on its rows.

use crate::error::{Error, Result};
use crate::log::Speed;
use crate::note::{LogNote, TableNote};
use crate::problem::{LineField, LineProblem, SpeedProblem};
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
            field: LineField::Line,
            problem: if utf16 {
                LineProblem::Utf16
            } else {
                LineProblem::NoText
            },
        }
    })
}

/// Adds notes on the rows that were not used.
pub(crate) fn left_out(notes: &mut Vec<LogNote>, rows: usize, absent: usize, repeated: usize) {
    if absent > 0 {
        notes.push(TableNote::NoSpeed { absent, rows }.into());
    }
    if repeated > 0 {
        notes.push(TableNote::Repeated { repeated, rows }.into());
    }
}

/// At most one row in this many may be out of order in time.
const ONE_ASTRAY_IN: usize = 100;

/// Rows left out because they are out of order in time: the clock went back for a moment, or jumped ahead and came back.
#[derive(Default)]
pub(crate) struct Astray {
    back: usize,
    ahead: usize,
    first: Option<Error>,
}

impl Astray {
    /// Keeps as many rows as can be in order of time. `error` makes the error for the first row that is before the one above; it takes
    /// the row and the difference in nanoseconds.
    pub(crate) fn leave_out<T>(
        &mut self,
        rows: Vec<(i64, T)>,
        error: impl FnOnce(&T, i64) -> Error,
    ) -> Vec<(i64, T)> {
        let times: Vec<i64> = rows.iter().map(|(ns, _)| *ns).collect();
        let Some(above) = times.windows(2).position(|pair| pair[1] < pair[0]) else {
            return rows;
        };
        let back_ns = times[above].saturating_sub(times[above + 1]);
        self.first = Some(error(&rows[above + 1].1, back_ns));
        let mut latest = i64::MIN;
        let mut kept = Vec::with_capacity(rows.len());
        for (row, in_order) in rows.into_iter().zip(in_order(&times)) {
            if in_order {
                latest = row.0;
                kept.push(row);
            } else if row.0 < latest {
                self.back += 1;
            } else {
                self.ahead += 1;
            }
        }
        kept
    }

    /// The notes on them, given the number of rows that are used.
    ///
    /// # Errors
    /// The error of the first such row, if more than one row in a hundred is out of order.
    pub(crate) fn notes(self, used: usize) -> Result<Vec<TableNote>> {
        let (back, ahead) = (self.back, self.ahead);
        let rows = back + ahead + used;
        if let Some(error) = self.first
            && (back + ahead) * ONE_ASTRAY_IN > rows
        {
            return Err(error);
        }
        let backwards = (back > 0).then_some(TableNote::Backwards { back, rows });
        let leaps = (ahead > 0).then_some(TableNote::Ahead { ahead, rows });
        Ok(backwards.into_iter().chain(leaps).collect())
    }
}

/// Which of these times to keep so that they never go back, keeping as many as possible: the longest non-decreasing subsequence, found by
/// patience sorting (Fredman 1975). If a clock jumps ahead for a moment, only that moment is lost, and not what follows it.
fn in_order(times: &[i64]) -> Vec<bool> {
    // For each length of a subsequence, the index of its smallest last time; for each time, the index of the time before it.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(times.len());
    for (place, time) in times.iter().enumerate() {
        let shorter = ends.partition_point(|end| times[*end] <= *time);
        before.push(shorter.checked_sub(1).map(|last| ends[last]));
        if shorter == ends.len() {
            ends.push(place);
        } else {
            ends[shorter] = place;
        }
    }
    let mut kept = vec![false; times.len()];
    let mut next = ends.last().copied();
    while let Some(place) = next {
        kept[place] = true;
        next = before[place];
    }
    kept
}

/// An error if there are fewer than two speeds.
pub(crate) fn enough(path: &Path, speeds: &[Speed]) -> Result<()> {
    match speeds.len() {
        rows @ (0 | 1) => Err(Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::TooFewRows { rows },
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::TableProblem;
    use proptest::prelude::*;

    /// The times that are kept, and the notes.
    fn sorted_out(times: &[i64]) -> (Vec<i64>, Result<Vec<TableNote>>) {
        let rows = times.iter().map(|ns| (*ns, ())).collect();
        let mut astray = Astray::default();
        let kept = astray.leave_out(rows, |(), back_ns| Error::Line {
            path: "trip.csv".into(),
            line: 1,
            field: LineField::Line,
            problem: TableProblem::Backwards {
                text: "x".into(),
                back_s: back_ns as f64,
            }
            .into(),
        });
        let kept: Vec<i64> = kept.into_iter().map(|(ns, ())| ns).collect();
        let notes = astray.notes(kept.len());
        (kept, notes)
    }

    /// Wherever the clock jumps, only that moment is lost.
    #[test]
    fn a_jump_ahead_costs_no_later_row() {
        let good: Vec<i64> = (0..400).collect();
        for at in [0, 1, 200, 397, 398] {
            let mut times = good.clone();
            times[at] = 86_400;
            let (kept, notes) = sorted_out(&times);
            let expected: Vec<i64> = good.iter().copied().filter(|t| *t != at as i64).collect();
            assert_eq!(kept, expected, "{at}");
            let leap = TableNote::Ahead {
                ahead: 1,
                rows: 400,
            };
            assert_eq!(notes.unwrap(), [leap], "{at}");
        }
        // A clock that was set back for good: the larger of the parts before and after is kept.
        let mut times = good.clone();
        times[398..].fill(7);
        let (kept, notes) = sorted_out(&times);
        assert_eq!(kept, good[..398]);
        let back = TableNote::Backwards { back: 2, rows: 400 };
        assert_eq!(notes.unwrap(), [back]);
    }

    #[test]
    fn unordered_rows_are_an_error_at_the_first_one() {
        let times: Vec<i64> = (0..100).chain(0..100).collect();
        let error = sorted_out(&times).1.unwrap_err().to_string();
        assert!(error.contains("99 s before the row above"), "{error}");
    }

    proptest! {
        #[test]
        fn kept_rows_are_in_order_and_ordered_rows_are_kept(times in prop::collection::vec(any::<i64>(), 0..60)) {
            let (kept, _) = sorted_out(&times);
            prop_assert!(kept.is_sorted());
            prop_assert!(times.is_empty() || !kept.is_empty());
            prop_assert_eq!(sorted_out(&kept).0, kept);
        }
    }
}
