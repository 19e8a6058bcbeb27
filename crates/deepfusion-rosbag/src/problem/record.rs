//! What is wrong with a record.

use crate::op::name_of;
use deepfusion_hint::count_of;
use std::fmt;

/// What is wrong with a record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordProblem {
    /// A part of it goes beyond the end of the file, or of its chunk.
    #[error("{part} goes beyond the end ({})", count_of(*bytes, "byte"))]
    BeyondEnd {
        /// The part.
        part: RecordPart,
        /// How many bytes the file or the chunk has.
        bytes: usize,
    },
    /// Its data is cut off.
    #[error(
        "a record's data should have {}, {left} {} left",
        count_of(*stated, "byte"),
        if *left == 1 { "is" } else { "are" }
    )]
    DataCut {
        /// How many bytes it should have.
        stated: usize,
        /// How many are there.
        left: usize,
    },
    /// It is of another kind than what has to stand there.
    #[error("expected {} (op {expected}), found {}", name_of(*expected), found_op(*found))]
    Kind {
        /// The field `op` that it should have.
        expected: u8,
        /// The one it has.
        found: Option<u8>,
    },
    /// It is no message.
    #[error("expected a message (op 2, conn, time)")]
    NoMessage,
    /// It is of a kind that stands elsewhere.
    #[error("op {op} cannot stand between chunks")]
    Misplaced {
        /// Its field `op`.
        op: u8,
    },
    /// There is no record.
    #[error("no record begins here (no field op)")]
    NoRecord,
    /// A field is missing.
    #[error("field {field} is missing")]
    NoField {
        /// The field's name.
        field: &'static str,
    },
    /// A field has another length than the format says.
    #[error("field {field} has {}, expected {expected}", count_of(*bytes, "byte"))]
    FieldLength {
        /// The field's name.
        field: &'static str,
        /// Its length.
        bytes: usize,
        /// The length it should have.
        expected: usize,
    },
}

fn found_op(found: Option<u8>) -> String {
    found.map_or_else(|| "no field op".to_owned(), |op| format!("op {op}"))
}

/// A part of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RecordPart {
    /// The length of its header.
    HeaderLength,
    /// Its header.
    Header {
        /// How many bytes it should have.
        bytes: usize,
    },
    /// The length of its data.
    DataLength,
}

impl fmt::Display for RecordPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HeaderLength => f.write_str("a record's header length"),
            Self::Header { bytes } => {
                write!(f, "a record's header of {}", count_of(*bytes, "byte"))
            }
            Self::DataLength => f.write_str("a record's data length"),
        }
    }
}
