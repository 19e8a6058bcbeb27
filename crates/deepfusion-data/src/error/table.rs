//! Why a CSV or JSON table cannot be used.

use deepfusion_hint::count_of;
use std::fmt;

/// Why a value in a CSV table cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableProblem {
    /// The cell is empty.
    #[error("empty, expected {expected}")]
    Empty {
        /// What it should be.
        expected: ExpectedCell,
    },
    /// The value is not what is expected.
    #[error("'{text}' is not {expected}")]
    NotA {
        /// What it should be.
        expected: ExpectedCell,
        /// The value, or its beginning.
        text: String,
    },
    /// The time is before that of the previous row.
    #[error("'{text}' is {seconds} s before the row above")]
    Earlier {
        /// The value.
        text: String,
        /// How much earlier it is, in seconds.
        seconds: f64,
    },
    /// The number of values in the row differs from that in the header.
    #[error("{}, but the header has {header}", count_of(*found, "value"))]
    Length {
        /// How many values the row has.
        found: u64,
        /// How many values the header has.
        header: u64,
    },
    /// The row is not UTF-8 text.
    #[error("not UTF-8 text")]
    NotText,
    /// Any other error of the CSV reader.
    #[error("{0}")]
    Csv(#[source] csv::Error),
}

impl TableProblem {
    /// The problem of a value that is not as expected. Long values are cut.
    pub(crate) fn not(expected: ExpectedCell, word: &str) -> Self {
        match word.chars().take(40).collect::<String>() {
            text if text.is_empty() => Self::Empty { expected },
            text => Self::NotA { expected, text },
        }
    }
}

/// What a value in a table should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExpectedCell {
    /// A finite number.
    Number,
    /// A time.
    Time,
    /// The name of an existing image.
    Image,
}

impl fmt::Display for ExpectedCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Number => "a finite number",
            Self::Time => "a time",
            Self::Image => "the name of an existing image",
        })
    }
}

/// What is wrong with a JSON table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JsonProblem {
    /// A row is not JSON, lacks a field, or has a field of the wrong type.
    // No source: its line numbers count from the row's first line.
    #[error("{}", without_place(.0))]
    Unread(serde_json::Error),
    /// An unexpected character between two rows.
    #[error("unexpected '{}'", found.escape_debug())]
    Unexpected {
        /// The character.
        found: char,
    },
    /// The file is truncated.
    #[error("the file ends within the table")]
    Ends,
    /// A row refers to one that the other table does not have.
    #[error("{table} has no row {token}")]
    NoRow {
        /// Name of the other table.
        table: &'static str,
        /// The row's token.
        token: String,
    },
    /// The recording has no such sensor.
    #[error("no sensor is called {name}")]
    NoSensor {
        /// The sensor's name.
        name: &'static str,
    },
    /// A quaternion is not a rotation.
    #[error("a quaternion of length {length:.3}, expected 1")]
    NotARotation {
        /// Its length.
        length: f64,
    },
    /// A camera matrix does not have three rows.
    #[error("{}, expected the 3 of a camera matrix", count_of(*rows, "row"))]
    NotAMatrix {
        /// How many rows it has.
        rows: usize,
    },
}

/// The parser's message without the position, which counts from the row's beginning.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_owned()
}
