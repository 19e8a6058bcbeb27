//! What `predict` and `perceive` do alike with a camera or a stream: always the newest frame, told how late it is.

mod feed;
mod figures;
mod folder;

pub use self::feed::{Feed, run};
pub use self::folder::{VIDEO, make_room};

use std::io::IsTerminal;
use std::time::UNIX_EPOCH;

use deepfusion_video::{Address, LiveFrame};
use serde::{Deserialize, Serialize};

use super::predict::inputs::Input;
use crate::cli::LiveArgs;
use crate::error::CliError;
use crate::failure::Result;

/// The live source among the arguments, if they name one; it is then alone, and options of live sources are for it.
pub fn source(inputs: &[String], args: &LiveArgs) -> Result<Option<Address>, CliError> {
    let mut found = inputs.iter().filter_map(|input| Address::parse(input));
    match (found.next(), args.given()) {
        (Some(address), _) if inputs.len() > 1 => Err(CliError::LiveAlone {
            address: address.to_string(),
        }),
        (Some(address), _) if address.is_stdin() && std::io::stdin().is_terminal() => {
            Err(CliError::Terminal)
        }
        (Some(address), _) => Ok(Some(address)),
        (None, Some(option)) => Err(CliError::OnlyLive { option }),
        (None, None) => Ok(None),
    }
}

/// What a frame has for having been live.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LiveMark {
    /// When it arrived, seconds since 1970.
    pub arrived_unix_s: f64,
    /// Frames of the source that were skipped so far.
    pub dropped: u64,
    /// From there to its depth (`predict`) or targets (`perceive`), milliseconds.
    pub latency_ms: f64,
}

impl LiveMark {
    /// Of a frame at which nobody has looked yet.
    pub fn of(frame: &LiveFrame) -> Self {
        let since_1970 = frame.arrived_at.duration_since(UNIX_EPOCH);
        Self {
            arrived_unix_s: since_1970.map_or(0.0, |d| d.as_secs_f64()),
            dropped: frame.dropped,
            latency_ms: 0.0,
        }
    }
}

/// A frame as an input among others: named by its place in the stream.
pub fn input(address: &Address, frame: &LiveFrame) -> Input {
    Input {
        path: address.to_string().into(),
        name: folder::name(frame.number),
        frame: None,
    }
}
