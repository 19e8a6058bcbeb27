//! What is wrong with a recording, grouped by what the checks examine.

mod assumed;
mod camera;
mod frames;
mod log;
mod motion;
mod opening;
mod pictures;

pub use self::camera::{CameraReason, CentreCoordinate, HeadingAngle, RoadAngle};
pub use self::frames::FramesReason;
pub use self::log::LogReason;
pub use self::motion::MotionReason;
pub use self::opening::OpeningReason;
pub use self::pictures::{ImageSide, PicturesReason};

use serde::{Serialize, Serializer};

/// No road vehicle is faster, in m/s; km/h taken for m/s are.
pub(crate) const MOST_MPS: f64 = 70.0;

/// Hint for a recording that cannot be opened, if there is no better one.
const CORRECT: &str = "correct what the message names";

/// What is wrong with a recording, and how it affects training.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FindingReason {
    /// What cannot be read, or was assumed.
    #[error(transparent)]
    Opening(#[from] OpeningReason),
    /// When the frames were taken, and whether the vehicle moved.
    #[error(transparent)]
    Frames(#[from] FramesReason),
    /// The camera's intrinsics and its mount on the vehicle.
    #[error(transparent)]
    Camera(#[from] CameraReason),
    /// The vehicle's speeds and turns, and its clock.
    #[error(transparent)]
    Motion(#[from] MotionReason),
    /// The pictures' motion, brightness and sharpness.
    #[error(transparent)]
    Pictures(#[from] PicturesReason),
    /// A log of speeds on its own.
    #[error(transparent)]
    Log(#[from] LogReason),
    /// A program's own words ([`crate::Diagnosis::unopened`], [`crate::Diagnosis::reworded`]).
    #[error("{0}")]
    Words(String),
}

impl FindingReason {
    /// What to do about it, in the library's words.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::Opening(reason) => reason.hint(),
            Self::Frames(reason) => reason.hint().to_owned(),
            Self::Camera(reason) => reason.hint(),
            Self::Motion(reason) => reason.hint(),
            Self::Pictures(reason) => reason.hint(),
            Self::Log(reason) => reason.hint(),
            Self::Words(_) => CORRECT.to_owned(),
        }
    }
}

/// As a string: the message.
impl Serialize for FindingReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind with its hint. All messages of a kind are tested beside it.
    #[test]
    fn a_reason_has_the_message_and_hint_of_its_kind() {
        let reasons: [FindingReason; 7] = [
            OpeningReason::CourseAlone.into(),
            FramesReason::Backwards { by_s: 0.5 }.into(),
            CameraReason::Swapped.into(),
            MotionReason::TurnsUnrelated.into(),
            PicturesReason::Dark.into(),
            LogReason::LocalDates.into(),
            FindingReason::Words("its gyroscope was warm".into()),
        ];
        let messages = [
            "no yaw rate was recorded, only a track of positions: the clock can be checked, but not turns and the camera's direction; training \
             takes the turns from the images",
            "its time stamp is 0.500 s earlier than that of the frame before",
            "points lie further right in camera 3 than in camera 2: the cameras are swapped",
            "the picture's turns do not follow the vehicle's: the clock, yaw rate or camera belongs to another drive",
            "most of the picture is black: nothing can be compared there",
            "the times are dates without a time zone, taken as UTC: hours off if they are local",
            "its gyroscope was warm",
        ];
        let hints = [
            "record an inertial unit or the steering angle",
            "sort the frames by time, or correct the time stamps",
            "swap the folders image_02 and image_03",
            "compare the time stamps and the yaw rate's unit (rad/s) and axis (z up)",
            "use a longer exposure, or leave out the darkest drives",
            "give the log's time zone; pictures and speeds show what remains of the clocks' offset",
            "correct what the message names",
        ];
        for ((reason, message), hint) in reasons.into_iter().zip(messages).zip(hints) {
            assert_eq!(reason.to_string(), message);
            assert_eq!(serde_json::to_value(&reason).unwrap(), message);
            assert_eq!(reason.hint(), hint);
        }
    }
}
