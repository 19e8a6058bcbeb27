//! What is wrong with a recording, by what the checks look at.

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

/// What to do about what cannot be opened, where nothing better is known.
const CORRECT: &str = "correct what the message names";

/// What is wrong with a recording, and what it does to a training.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FindingReason {
    /// What cannot be read, or is taken for granted.
    #[error(transparent)]
    Opening(#[from] OpeningReason),
    /// When the frames were taken, and whether the vehicle moved.
    #[error(transparent)]
    Frames(#[from] FramesReason),
    /// The camera's numbers and its place on the vehicle.
    #[error(transparent)]
    Camera(#[from] CameraReason),
    /// The vehicle's speeds and turns, and its clock.
    #[error(transparent)]
    Motion(#[from] MotionReason),
    /// How the pictures look.
    #[error(transparent)]
    Pictures(#[from] PicturesReason),
    /// A log of speeds by itself.
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

/// As its text.
impl Serialize for FindingReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind, with what to do about it: what a kind says itself is tested beside it.
    #[test]
    fn a_reason_says_what_its_kind_says() {
        let reasons: [FindingReason; 7] = [
            OpeningReason::CourseAlone.into(),
            FramesReason::Backwards { by_s: 0.5 }.into(),
            CameraReason::Swapped.into(),
            MotionReason::TurnsUnrelated.into(),
            PicturesReason::Dark.into(),
            LogReason::LocalDates.into(),
            FindingReason::Words("its gyroscope was warm".into()),
        ];
        let said = [
            "no yaw rate was recorded, but a track of positions: the clock can be checked, turns and the camera's direction cannot; training \
             takes the turns from the images",
            "its time stamp is 0.500 s before the frame before",
            "what camera 2 sees lies further right in camera 3: the two are swapped",
            "the picture's turns do not follow the vehicle's: clock, yaw rate or camera are not of this drive",
            "most of the picture is black: nothing can be compared there",
            "dates without a zone, taken for UTC: hours off where they are local",
            "its gyroscope was warm",
        ];
        let hints = [
            "record an inertial unit or the steering angle",
            "sort the frames by time, or correct the time stamps",
            "rename image_02 to image_03 and the other way round",
            "compare the time stamps and the yaw rate's unit (rad/s) and axis (z up)",
            "expose longer, or leave the darkest drives out",
            "say the log's time zone; pictures and speeds show what is left between the clocks",
            "correct what the message names",
        ];
        for ((reason, said), hint) in reasons.into_iter().zip(said).zip(hints) {
            assert_eq!(reason.to_string(), said);
            assert_eq!(serde_json::to_value(&reason).unwrap(), said);
            assert_eq!(reason.hint(), hint);
        }
    }
}
