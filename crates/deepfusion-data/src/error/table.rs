//! Why a table cannot be used: of comma-separated values, or of JSON.

use deepfusion_hint::count_of;
use std::fmt;

/// Why a value of a table cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableProblem {
    /// It is empty.
    #[error("empty, expected {expected}")]
    Empty {
        /// What it should be.
        expected: ExpectedCell,
    },
    /// It is something else.
    #[error("'{text}' is not {expected}")]
    NotA {
        /// What it should be.
        expected: ExpectedCell,
        /// The value, or its beginning.
        text: String,
    },
    /// It is a time that goes back.
    #[error("'{text}' is {seconds} s before the row above")]
    Earlier {
        /// The value.
        text: String,
        /// By how much.
        seconds: f64,
    },
    /// The row has another number of values than the header.
    #[error("{}, the header has {header}", count_of(*found, "value"))]
    Length {
        /// How many the row has.
        found: u64,
        /// How many the header.
        header: u64,
    },
    /// The row is no text.
    #[error("not UTF-8 text")]
    NotText,
    /// What else the reader of comma-separated tables does not understand.
    #[error("{0}")]
    Csv(#[source] csv::Error),
}

impl TableProblem {
    /// Of a value that is not what it should be; it is shown short, however long it is.
    pub(crate) fn not(expected: ExpectedCell, word: &str) -> Self {
        match word.chars().take(40).collect::<String>() {
            text if text.is_empty() => Self::Empty { expected },
            text => Self::NotA { expected, text },
        }
    }
}

/// What a value of a table should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExpectedCell {
    /// A finite number.
    Number,
    /// A time.
    Time,
    /// The name of an image that is there.
    Image,
}

impl fmt::Display for ExpectedCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Number => "a finite number",
            Self::Time => "a time",
            Self::Image => "the name of an image that is there",
        })
    }
}

/// What is wrong with a table of JSON.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JsonProblem {
    /// A row is no JSON, or lacks a field, or has one of another type.
    // No source: that would count the line from the row's first on.
    #[error("{}", without_place(.0))]
    Unread(serde_json::Error),
    /// Something else than a row, between two of them.
    #[error("'{}' is not expected here", found.escape_debug())]
    Unexpected {
        /// What is there.
        found: char,
    },
    /// The file is not whole.
    #[error("the file ends within the table")]
    Ends,
    /// It names a row that another table has not.
    #[error("{table} has no row {token}")]
    NoRow {
        /// The other table.
        table: &'static str,
        /// The row's token.
        token: String,
    },
    /// The recording has no such sensor.
    #[error("no sensor is {name}")]
    NoSensor {
        /// The sensor's name.
        name: &'static str,
    },
    /// A quaternion that is no rotation.
    #[error("a quaternion of length {length:.3}, expected 1")]
    NotARotation {
        /// Its length.
        length: f64,
    },
    /// A matrix that is no camera's.
    #[error("{}, expected the 3 of a camera matrix", count_of(*rows, "row"))]
    NotAMatrix {
        /// How many rows it has.
        rows: usize,
    },
}

/// What the parser says but for its place, which is counted from the row's beginning.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_owned()
}
