//! Pictures without the whole board, and why.

use std::fmt;

use serde::{Serialize, Serializer};

/// A picture without the whole board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The picture's name.
    pub name: String,
    /// Why it was left out.
    pub why: LeftOutReason,
}

/// Why a picture shows no whole board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LeftOutReason {
    /// No board, or too few corners.
    NoBoard,
    /// A grid with more corners on a side than the board.
    OtherGrid {
        /// Corners from left to right.
        columns: usize,
        /// Corners from top to bottom.
        rows: usize,
    },
    /// Only a part of the board.
    Incomplete {
        /// Number of corners found.
        corners: usize,
        /// Number of corners of the board.
        of: usize,
    },
}

impl fmt::Display for LeftOutReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoBoard => f.write_str("no board"),
            Self::OtherGrid { columns, rows } => write!(f, "a grid of {columns}x{rows}"),
            Self::Incomplete { corners, of } => write!(f, "{corners} of {of} corners"),
        }
    }
}

/// The text form, as printed.
impl Serialize for LeftOutReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_serialised_as_text() {
        let (columns, rows) = (11, 6);
        for (why, expected) in [
            (LeftOutReason::NoBoard, "no board"),
            (LeftOutReason::OtherGrid { columns, rows }, "a grid of 11x6"),
            (
                LeftOutReason::Incomplete {
                    corners: 40,
                    of: 54,
                },
                "40 of 54 corners",
            ),
        ] {
            let name = "a.png".to_owned();
            let written = serde_json::to_value(LeftOut { name, why }).unwrap();
            assert_eq!(
                written,
                serde_json::json!({"name": "a.png", "why": expected})
            );
        }
    }
}
