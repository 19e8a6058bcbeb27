//! What is wrong with a CAN trace.

use deepfusion_hint::count_of;

/// Why a CAN trace has no signal to decode.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalProblem {
    /// There is no DBC file.
    #[error("a CAN trace needs a DBC file that describes its frames")]
    NoDbc,
    /// No signal was named.
    #[error(
        "it is not known which signal of the CAN trace is the speed{}",
        by_name(candidates)
    )]
    NoName {
        /// Signals of the DBC file whose name contains speed.
        candidates: Vec<String>,
    },
    /// The signal's unit is not one of speed.
    #[error("the unit of {signal} in the DBC file, '{unit}', is not a unit of speed")]
    Unit {
        /// The signal's name.
        signal: String,
        /// The unit as in the file.
        unit: String,
    },
}

fn by_name(candidates: &[String]) -> String {
    if candidates.is_empty() {
        String::new()
    } else {
        format!("; candidates: {}", candidates.join(", "))
    }
}

/// Why a frame of a CAN trace cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CanFrameProblem {
    /// The frame's time is invalid.
    #[error("'{0}' is not a time in seconds")]
    Time(String),
    /// The frame's identifier is not a number.
    #[error("'{0}' is not an identifier")]
    Identifier(String),
    /// The identifier of a standard frame is too large.
    #[error("identifier {0:X} has more than 11 bits")]
    LongIdentifier(u32),
    /// The frame has fewer bytes than its length field says.
    #[error("it has {}, its length field says {length}", count_of(*bytes, "byte"))]
    Length {
        /// Number of bytes.
        bytes: usize,
        /// The length in the frame, bytes.
        length: usize,
    },
    /// A byte is invalid.
    #[error("'{0}' is not a byte")]
    Byte(String),
    /// The bytes of data are invalid.
    #[error("'{0}' are not bytes")]
    Bytes(String),
}
