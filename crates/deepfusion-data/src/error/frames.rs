//! How the transforms of a bag's frames contradict each other.

use crate::formats::Change;
use std::path::PathBuf;

/// How the transforms of a bag's frames contradict each other.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesProblem {
    /// They say two places of a sensor.
    #[error(
        "{mount} is ambiguous: the frames {} and {} are {} apart",
        ways[0].join(" → "), ways[1].join(" → "), Change { metres: *metres, radians: *radians }
    )]
    TwoWays {
        /// The mount, by its key in the file beside the bag.
        mount: &'static str,
        /// The frames from the sensor to what it is mounted on, one way and the other.
        ways: Box<[Vec<String>; 2]>,
        /// How far apart the two places are.
        metres: f64,
        /// By how much they are turned against each other.
        radians: f64,
        /// The file beside the bag.
        config: PathBuf,
    },
    /// Two frames that could be the vehicle's are not the same.
    #[error("{first} and {other} could both be the vehicle's frame")]
    TwoVehicles {
        /// One.
        first: String,
        /// The other.
        other: String,
        /// The file beside the bag.
        config: PathBuf,
    },
}

impl FramesProblem {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let (hint, config) = match self {
            Self::TwoWays { mount, config, .. } => (
                format!("say it: [{mount}] translation = […], rotation = […]"),
                config,
            ),
            Self::TwoVehicles { first, config, .. } => {
                (format!("frames.vehicle = \"{first}\""), config)
            }
        };
        format!("{hint} (in {})", config.display())
    }
}
