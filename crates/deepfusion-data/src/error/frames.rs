//! How the transforms between a bag's frames contradict each other.

use crate::formats::Change;
use std::path::PathBuf;

/// How the transforms between a bag's frames contradict each other.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesProblem {
    /// They place a sensor in two different ways.
    #[error(
        "{mount} is ambiguous: the frames {} and {} are {} apart",
        ways[0].join(" → "), ways[1].join(" → "), Change { metres: *metres, radians: *radians }
    )]
    TwoWays {
        /// The mount's key in the file beside the bag.
        mount: &'static str,
        /// The two chains of frames from the sensor to what it is mounted on.
        ways: Box<[Vec<String>; 2]>,
        /// Distance between the two positions, in metres.
        metres: f64,
        /// Angle between the two orientations, in radians.
        radians: f64,
        /// Path of the file beside the bag.
        config: PathBuf,
    },
    /// Two frames that could be the vehicle's differ.
    #[error("{first} and {other} could both be the vehicle's frame")]
    TwoVehicles {
        /// Name of one frame.
        first: String,
        /// Name of the other frame.
        other: String,
        /// Path of the file beside the bag.
        config: PathBuf,
    },
}

impl FramesProblem {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let (hint, config) = match self {
            Self::TwoWays { mount, config, .. } => (
                format!("set [{mount}] translation = […], rotation = […]"),
                config,
            ),
            Self::TwoVehicles { first, config, .. } => {
                (format!("set frames.vehicle = \"{first}\""), config)
            }
        };
        format!("{hint} (in {})", config.display())
    }
}
