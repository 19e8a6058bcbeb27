//! Why a check could not look.

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

/// Why a check could not look, or not at everything.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkipReason {
    /// The recording cannot be opened.
    #[error("the recording cannot be opened")]
    NotOpened,
    /// What it looks at cannot be read.
    #[error(transparent)]
    Unreadable(#[from] SharedError<Error>),
    /// The frames do not show it.
    #[error(transparent)]
    Frames(#[from] FramesSkip),
    /// Nothing shows where the camera looks.
    #[error(transparent)]
    Camera(#[from] CameraSkip),
    /// Nothing shows how the vehicle moved.
    #[error(transparent)]
    Motion(#[from] MotionSkip),
    /// Nothing shows how far the clocks are apart.
    #[error(transparent)]
    Clock(#[from] ClockSkip),
    /// The pictures do not show it.
    #[error(transparent)]
    Pictures(#[from] PicturesSkip),
    /// A log by itself does not say it.
    #[error(transparent)]
    Log(#[from] LogSkip),
}

/// As its text.
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

    /// One of each kind: what a kind says itself is tested beside it.
    #[test]
    fn a_reason_says_what_its_kind_says() {
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
        let said = [
            "the recording cannot be opened",
            message.as_str(),
            "the frames have no time stamps",
            "one camera",
            "no LiDAR with radial velocities, or no scans of it while the vehicle moves",
            "no speed and yaw rate to compare the picture with",
            "no image has any detail",
            "the camera's own clock",
        ];
        for (reason, said) in reasons.into_iter().zip(said) {
            assert_eq!(reason.to_string(), said);
            assert_eq!(serde_json::to_value(&reason).unwrap(), said);
        }
    }
}
