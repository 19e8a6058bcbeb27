//! What to do about a log of speeds by itself.

use std::fmt;

/// What to do about a log of speeds by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogRemedy {
    /// Speeds that are far apart in time.
    LogOften,
    /// A time without speeds.
    BridgeGap,
    /// A vehicle that stands.
    LogDrive,
}

impl fmt::Display for LogRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LogOften => "log at 1 Hz or more; an OBD reader or CAN gives ten a second",
            Self::BridgeGap => "max_gap_s in dataset.toml bridges it in a straight line, where the vehicle did not stop in between",
            Self::LogDrive => "log a drive",
        })
    }
}
