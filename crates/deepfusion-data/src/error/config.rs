//! What is wrong with a `dataset.toml`, or with a bag's configuration file.

use super::can::CanProblem;
use deepfusion_motion::SPEED_SCALES;
use std::fmt;
use std::path::PathBuf;

/// What is wrong with a `dataset.toml`, or with a bag's configuration file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigProblem {
    /// The file is not TOML, or has unknown keys or invalid values.
    // No source: it would print the same again, followed by an empty line.
    #[error("{}", .0.to_string().trim_end())]
    Unread(Box<toml::de::Error>),
    /// The contents cannot be written as TOML.
    #[error("{0}")]
    Unwritable(#[source] Box<toml::ser::Error>),
    /// A number is out of its range.
    #[error("{key} is {value}{expected}")]
    Value {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: ExpectedValue,
    },
    /// A list has a number that is NaN or infinite.
    #[error("{key} has a number that is not finite")]
    NotFinite {
        /// The key.
        key: &'static str,
    },
    /// A named file or folder does not exist.
    #[error("{key}: {}: no such file or folder", path.display())]
    NoFile {
        /// The key.
        key: &'static str,
        /// Path of the missing file or folder.
        path: PathBuf,
    },
    /// Both `intrinsics` and `hfov_deg` are set.
    #[error("intrinsics and hfov_deg are both set: keep one of them")]
    IntrinsicsAndView,
    /// Both `[camera]` and `calibration` are set.
    #[error("[camera] and calibration are both set: keep one of them")]
    CameraAndCalibration,
    /// The profile is unknown.
    #[error("profile is unknown, expected one of {}", known.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", "))]
    NoProfile {
        /// Names of the known profiles.
        known: Vec<&'static str>,
    },
    /// A named frame is in none of the bag's transforms.
    #[error("frames.{key}: {name} is in no transform; {}", there_are(there))]
    NoFrame {
        /// The key in `[frames]`.
        key: &'static str,
        /// Name of the frame.
        name: String,
        /// Names of the frames in the transforms.
        there: Vec<String>,
    },
    /// The speed's topic has plain numbers, and their unit is missing.
    #[error(
        "vehicle.speed_unit is missing: {topic} has plain numbers; expected \"m/s\", \"km/h\" or \"mph\""
    )]
    NoSpeedUnit {
        /// Name of the speed's topic.
        topic: String,
    },
    /// A signal of CAN frames cannot be used.
    #[error(transparent)]
    Can(#[from] CanProblem),
    /// The folder has several videos, and none is named.
    #[error("the folder has {count} videos, and `video` chooses none")]
    SeveralVideos {
        /// Number of videos.
        count: usize,
    },
    /// The folder has several GPS tracks, and none is named.
    #[error("the folder has {count} tracks (.gpx, .nmea), and `speed` chooses none")]
    SeveralTracks {
        /// Number of tracks.
        count: usize,
    },
    /// The folder has images and a video, and neither is named.
    #[error("the folder has images and a video ({}), and neither `images` nor `video` is set", video.display())]
    ImagesAndVideo {
        /// Path of the video.
        video: PathBuf,
    },
}

impl From<toml::de::Error> for ConfigProblem {
    fn from(error: toml::de::Error) -> Self {
        Self::Unread(Box::new(error))
    }
}

/// What a number in a `dataset.toml`, or in a bag's configuration file, must be.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ExpectedValue {
    /// A finite number, whose quantity and unit are in the key's name.
    AsNamed,
    /// Above 0.
    Positive,
    /// A time in seconds.
    Time,
    /// A time above 0, at most this, in seconds.
    TimeUpTo(f64),
    /// A gap that can be bridged: at most this, in seconds.
    GapUpTo(f64),
    /// An angle between these, in degrees.
    Between(f64, f64),
    /// A scale for speeds: true speed / measured speed.
    SpeedScale,
}

impl fmt::Display for ExpectedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AsNamed => Ok(()),
            Self::Positive => f.write_str(", expected a number above 0"),
            Self::Time => f.write_str(", expected a time in seconds"),
            Self::TimeUpTo(most) => write!(f, ", expected a time above 0 s, at most {most} s"),
            Self::GapUpTo(most) => write!(f, ", but at most {most} s can be bridged"),
            Self::Between(least, most) => {
                write!(
                    f,
                    ", expected more than {least} and less than {most} degrees"
                )
            }
            Self::SpeedScale => {
                let (least, most) = (SPEED_SCALES.start(), SPEED_SCALES.end());
                write!(f, ", expected {least} to {most} (not for converting units)")
            }
        }
    }
}

fn there_are(frames: &[String]) -> String {
    match frames {
        [] => "the bag has no transforms".to_owned(),
        names => format!("the bag's frames are {}", names.join(", ")),
    }
}
