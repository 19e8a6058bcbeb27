//! What is wrong with a record.

use crate::op::name_of;
use deepfusion_hint::count_of;
use std::fmt;

/// What is wrong with a record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordProblem {
    /// A part of the record goes beyond the end of the file, or of its chunk.
    #[error("{part} goes beyond the end ({})", count_of(*bytes, "byte"))]
    BeyondEnd {
        /// The part.
        part: RecordPart,
        /// Length of the file or the chunk, bytes.
        bytes: usize,
    },
    /// The record's data is cut off.
    #[error(
        "a record's data should have {}, {left} {} left",
        count_of(*stated, "byte"),
        if *left == 1 { "is" } else { "are" }
    )]
    DataCut {
        /// Number of bytes it should have.
        stated: usize,
        /// Number of bytes left.
        left: usize,
    },
    /// The record is of another kind than expected.
    #[error("expected {} (op {expected}), found {}", name_of(*expected), found_op(*found))]
    Kind {
        /// The expected value of the field `op`.
        expected: u8,
        /// The value it has.
        found: Option<u8>,
    },
    /// The record is not a message.
    #[error("expected a message (op 2, conn, time)")]
    NoMessage,
    /// The record is of a kind that is not allowed here.
    #[error("op {op} is not allowed between chunks")]
    Misplaced {
        /// The field `op` of the record.
        op: u8,
    },
    /// There is no record.
    #[error("not a record (no field op)")]
    NoRecord,
    /// A field is missing.
    #[error("field {field} is missing")]
    NoField {
        /// Name of the field.
        field: &'static str,
    },
    /// A field has another length than the format says.
    #[error("field {field} has {}, expected {expected}", count_of(*bytes, "byte"))]
    FieldLength {
        /// Name of the field.
        field: &'static str,
        /// Length of the field, bytes.
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
        /// Number of bytes it should have.
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
