//! What is wrong with a CAN trace.

use deepfusion_hint::count_of;

/// Why a CAN trace has no signal to decode.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalProblem {
    /// There is no DBC file.
    #[error("nothing says what its frames hold: a DBC file does")]
    NoDbc,
    /// No signal was named.
    #[error("nothing says which signal is the speed{}", by_name(candidates))]
    NoName {
        /// Signals of the DBC file that are called a speed.
        candidates: Vec<String>,
    },
    /// The signal's unit is not one of speed.
    #[error("the DBC file's unit of {signal}, '{unit}', is not one of speed")]
    Unit {
        /// The signal's name.
        signal: String,
        /// The unit, as the file has it.
        unit: String,
    },
}

fn by_name(candidates: &[String]) -> String {
    if candidates.is_empty() {
        String::new()
    } else {
        format!("; by their names: {}", candidates.join(", "))
    }
}

/// Why a frame of a CAN trace cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CanFrameProblem {
    /// Its time is none.
    #[error("'{0}' is not a time in seconds")]
    Time(String),
    /// Its identifier is not a number.
    #[error("'{0}' is not an identifier")]
    Identifier(String),
    /// Its identifier is too large for a standard frame's.
    #[error("identifier {0:X} has more than 11 bits")]
    LongIdentifier(u32),
    /// It has fewer bytes than it says.
    #[error("{}, its length says {length}", count_of(*bytes, "byte"))]
    Length {
        /// How many it has.
        bytes: usize,
        /// How many it says.
        length: usize,
    },
    /// A byte is none.
    #[error("'{0}' is not a byte")]
    Byte(String),
    /// Its bytes are none.
    #[error("'{0}' are not bytes")]
    Bytes(String),
}
