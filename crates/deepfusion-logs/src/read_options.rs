//! What a user says of a log.

use crate::SpeedUnit;
use std::path::PathBuf;

/// What a user says of a log, where it does not say it itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The column of times, by its header.
    pub time: Option<String>,
    /// The column of speeds by its header; of a tall table the name of its rows; of a CAN trace the signal, "Message.Signal".
    pub speed: Option<String>,
    /// The speeds' unit, where nothing else says it; what the log says counts before it.
    pub unit: Option<SpeedUnit>,
    /// A DBC file, for CAN traces.
    pub dbc: Option<PathBuf>,
}
