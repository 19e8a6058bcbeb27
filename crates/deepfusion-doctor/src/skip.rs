//! Why a check could not be made.

mod camera;
mod clock;
mod frames;
mod log;
mod motion;
mod pictures;

pub use self::camera::{CameraSkip, NoHeading, UnsureHeading};
pub use self::clock::ClockSkip;
pub use self::frames::FramesSkip;
pub use self::log::LogSkip;
pub use self::motion::MotionSkip;
pub use self::pictures::PicturesSkip;

use crate::shared_error::SharedError;
use deepfusion_data::Error;
use serde::{Serialize, Serializer};

/// Why a check could not be made, or not in full.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkipReason {
    /// The recording cannot be opened.
    #[error("the recording cannot be opened")]
    NotOpened,
    /// The data that it examines cannot be read.
    #[error(transparent)]
    Unreadable(#[from] SharedError<Error>),
    /// The frames do not allow the check.
    #[error(transparent)]
    Frames(#[from] FramesSkip),
    /// The camera's direction cannot be found.
    #[error(transparent)]
    Camera(#[from] CameraSkip),
    /// The vehicle's motion is not known well enough.
    #[error(transparent)]
    Motion(#[from] MotionSkip),
    /// The clocks' offset cannot be found.
    #[error(transparent)]
    Clock(#[from] ClockSkip),
    /// The pictures do not allow the check.
    #[error(transparent)]
    Pictures(#[from] PicturesSkip),
    /// The log does not allow the check.
    #[error(transparent)]
    Log(#[from] LogSkip),
}

/// As a string: the message.
impl Serialize for SkipReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::ErrorKind;
    use std::path::Path;

    /// One of each kind. All messages of a kind are tested beside it.
    #[test]
    fn a_reason_has_the_message_of_its_kind() {
        let error = Error::file(Path::new("drive"), ErrorKind::NotFound.into());
        let message = error.to_string();
        let reasons: [SkipReason; 8] = [
            SkipReason::NotOpened,
            SharedError::from(error).into(),
            FramesSkip::NoTimes.into(),
            CameraSkip::OneCamera.into(),
            MotionSkip::NoRadialVelocities.into(),
            ClockSkip::NoRates.into(),
            PicturesSkip::NoDetail.into(),
            LogSkip::OwnClock.into(),
        ];
        let messages = [
            "the recording cannot be opened",
            message.as_str(),
            "the frames have no time stamps",
            "the recording has one camera",
            "no LiDAR with radial velocities, or no scans of it while the vehicle moves",
            "no speed and yaw rate to compare the picture with",
            "no image has any detail",
            "the log is on the camera's own clock",
        ];
        for (reason, message) in reasons.into_iter().zip(messages) {
            assert_eq!(reason.to_string(), message);
            assert_eq!(serde_json::to_value(&reason).unwrap(), message);
        }
    }
}
