//! What to do about what a check found.

mod camera;
mod frames;
mod log;
mod motion;
mod opening;
mod pictures;

pub use self::camera::CameraRemedy;
pub use self::frames::FramesRemedy;
pub use self::log::LogRemedy;
pub use self::motion::MotionRemedy;
pub use self::opening::OpeningRemedy;
pub use self::pictures::PicturesRemedy;

use deepfusion_logs::Clock;
use serde::{Serialize, Serializer};
use std::fmt;
use std::path::PathBuf;

/// What to do about a finding. As text it is in the library's words; from [`Self::OtherLog`] on, a program may say which of its own options does it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// About what cannot be read, or is taken for granted.
    Opening(OpeningRemedy),
    /// About the frames and their times.
    Frames(FramesRemedy),
    /// About the camera's numbers and its place on the vehicle.
    Camera(CameraRemedy),
    /// About the vehicle's speeds and turns.
    Motion(MotionRemedy),
    /// About how the pictures look.
    Pictures(PicturesRemedy),
    /// About a log of speeds by itself.
    Log(LogRemedy),
    /// What a reader's error says itself ([`deepfusion_hint::Hint`]).
    Hint(String),
    /// A program's own words ([`crate::Diagnosis::unopened`], [`crate::Diagnosis::reworded`]).
    Words(String),
    /// The camera's GPS switched on, or another log beside the video.
    OtherLog,
    /// The DBC file of a CAN trace, and the speed's signal in it.
    Signal,
    /// The log's columns of time and speed and the speed's unit; what the log's own error says of them.
    Columns(String),
    /// The unit of the log's speeds.
    SpeedUnit,
    /// Faster or longer drives, or the vehicle's own speed.
    VehicleSpeed,
    /// Making a drive of the log.
    Import {
        /// The log.
        log: PathBuf,
        /// Whether the pictures are in a file of their own.
        video: bool,
    },
    /// Poses that need no turns, or a log that has them.
    Turns {
        /// Whether a course of positions shows some.
        from_positions: bool,
    },
    /// What connects the clock of a log with the video's.
    StartOfVideo(Clock),
    /// The offset of the camera's clock that was measured.
    ClockOffset {
        /// How far the camera's clock is ahead of the vehicle's, in seconds.
        camera_ahead_s: f64,
    },
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Opening(remedy) => write!(f, "{remedy}"),
            Self::Frames(remedy) => write!(f, "{remedy}"),
            Self::Camera(remedy) => write!(f, "{remedy}"),
            Self::Motion(remedy) => write!(f, "{remedy}"),
            Self::Pictures(remedy) => write!(f, "{remedy}"),
            Self::Log(remedy) => write!(f, "{remedy}"),
            Self::Hint(words) | Self::Words(words) => f.write_str(words),
            Self::OtherLog => f.write_str(
                "switch the camera's GPS on and wait for its fix; or bring another log beside the video",
            ),
            Self::Signal => {
                f.write_str("give the DBC file, and the speed's signal as Message.Signal")
            }
            Self::Columns(hint) => write!(f, "{hint}, and the speed's unit"),
            Self::SpeedUnit => f.write_str("say the unit of speed (m/s, km/h, mph, knots)"),
            Self::VehicleSpeed => {
                f.write_str("drive faster or longer, or log the vehicle's own speed: OBD, CAN")
            }
            Self::Import { log, video } => {
                let beside = if *video { " with its video" } else { "" };
                let log = log.display();
                write!(f, "make a drive of {log}{beside} and the camera; then examine the drive")
            }
            Self::Turns { .. } => f.write_str(
                "poses by the network or by the distance driven need no turns; a second log with a gyroscope brings them",
            ),
            Self::StartOfVideo(Clock::LocalDate) => {
                f.write_str("say the log's time zone; pictures and speeds show what is left between the clocks")
            }
            Self::StartOfVideo(Clock::TimeOfDay | Clock::Free) => f.write_str(
                "say when the first frame was taken, on the log's clock; pictures and speeds show what is left between the clocks",
            ),
            Self::StartOfVideo(Clock::Date | Clock::Video) => {
                f.write_str("pictures and speeds show what is left between the clocks")
            }
            Self::ClockOffset { camera_ahead_s } => write!(
                f,
                "clock.camera_ahead_s = {camera_ahead_s:.3} in the file beside the recording, or a clock offset of {:.0} ms given. Better: one clock \
                 for all (PTP, trigger)",
                1e3 * camera_ahead_s
            ),
        }
    }
}

/// As its text.
impl Serialize for Remedy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl From<OpeningRemedy> for Remedy {
    fn from(remedy: OpeningRemedy) -> Self {
        Self::Opening(remedy)
    }
}

impl From<FramesRemedy> for Remedy {
    fn from(remedy: FramesRemedy) -> Self {
        Self::Frames(remedy)
    }
}

impl From<CameraRemedy> for Remedy {
    fn from(remedy: CameraRemedy) -> Self {
        Self::Camera(remedy)
    }
}

impl From<MotionRemedy> for Remedy {
    fn from(remedy: MotionRemedy) -> Self {
        Self::Motion(remedy)
    }
}

impl From<PicturesRemedy> for Remedy {
    fn from(remedy: PicturesRemedy) -> Self {
        Self::Pictures(remedy)
    }
}

impl From<LogRemedy> for Remedy {
    fn from(remedy: LogRemedy) -> Self {
        Self::Log(remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind: what a kind says itself is tested beside it.
    #[test]
    fn a_remedy_says_what_its_kind_says() {
        let remedies: [Remedy; 8] = [
            OpeningRemedy::Correct.into(),
            FramesRemedy::SortFrames.into(),
            CameraRemedy::CopyAgain.into(),
            MotionRemedy::LidarYaw.into(),
            PicturesRemedy::ExposeShorter.into(),
            LogRemedy::LogDrive.into(),
            Remedy::Hint("ask the camera".into()),
            Remedy::Words("give --hfov".into()),
        ];
        let said = [
            "correct what the message names",
            "sort the frames by time, or correct the time stamps",
            "copy the recording again",
            "correct the yaw of cam_from_lidar or of cam_from_vehicle by that angle",
            "expose shorter",
            "log a drive",
            "ask the camera",
            "give --hfov",
        ];
        for (remedy, said) in remedies.into_iter().zip(said) {
            assert_eq!(remedy.to_string(), said);
            assert_eq!(serde_json::to_value(&remedy).unwrap(), said);
        }
    }
}
