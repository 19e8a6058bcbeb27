//! What is wrong with a `dataset.toml`, or with the file beside a bag.

use super::can::CanProblem;
use deepfusion_motion::SPEED_SCALES;
use std::fmt;
use std::path::PathBuf;

/// What is wrong with a `dataset.toml`, or with the file beside a bag.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigProblem {
    /// It is no TOML, or has keys or values that mean nothing here.
    // No source: that would say the same again, with an empty line behind it.
    #[error("{}", .0.to_string().trim_end())]
    Unread(Box<toml::de::Error>),
    /// What it is to hold has no TOML.
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
    /// A list of numbers holds NaN or an infinite one.
    #[error("{key} holds a number that is not finite")]
    NotFinite {
        /// The key.
        key: &'static str,
    },
    /// A file or folder that it names is not there.
    #[error("{key}: there is no {}", path.display())]
    NoFile {
        /// The key.
        key: &'static str,
        /// Where it should be.
        path: PathBuf,
    },
    /// `intrinsics` and `hfov_deg` at once.
    #[error("both intrinsics and hfov_deg say what the camera is: keep one")]
    IntrinsicsAndView,
    /// `[camera]` and `calibration` at once.
    #[error("[camera] and calibration both say what the camera is: keep one of them")]
    CameraAndCalibration,
    /// A profile that does not come with this program.
    #[error("profile: the only one there is is {}", known.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", "))]
    NoProfile {
        /// Those that do.
        known: Vec<&'static str>,
    },
    /// A frame by its name, which no transform has.
    #[error("frames.{key}: {name} is in no transform; {}", there_are(there))]
    NoFrame {
        /// The key in `[frames]`.
        key: &'static str,
        /// The name.
        name: String,
        /// The frames that there are.
        there: Vec<String>,
    },
    /// The unit of a bare number, which is the speed.
    #[error(
        "vehicle.speed_unit is missing: {topic} is a bare number, \"m/s\", \"km/h\" or \"mph\""
    )]
    NoSpeedUnit {
        /// The topic of the speed.
        topic: String,
    },
    /// The signals of CAN frames.
    #[error(transparent)]
    Can(#[from] CanProblem),
    /// Several videos, and none is named.
    #[error("{count} videos are there: name one, video = \"…\", or give its path")]
    SeveralVideos {
        /// How many.
        count: usize,
    },
    /// Several GPS tracks, and none is named.
    #[error("{count} tracks are there (.gpx, .nmea): name one, speed = \"…\"")]
    SeveralTracks {
        /// How many.
        count: usize,
    },
    /// Images and a video, and neither is named.
    #[error("there are images and a video ({}): name one, images = \"…\" or video = \"…\"", video.display())]
    ImagesAndVideo {
        /// The video.
        video: PathBuf,
    },
}

impl From<toml::de::Error> for ConfigProblem {
    fn from(error: toml::de::Error) -> Self {
        Self::Unread(Box::new(error))
    }
}

/// What a number of a `dataset.toml`, or of the file beside a bag, must be.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ExpectedValue {
    /// What the key's name says, and finite.
    AsNamed,
    /// Above 0.
    Positive,
    /// A time in seconds.
    Time,
    /// A time above 0, at most this, in seconds.
    TimeUpTo(f64),
    /// A gap that can be bridged: this at most, in seconds.
    GapUpTo(f64),
    /// An angle between these, in degrees.
    Between(f64, f64),
    /// A true speed over the vehicle's.
    SpeedScale,
}

impl fmt::Display for ExpectedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AsNamed => Ok(()),
            Self::Positive => f.write_str(", it must be above 0"),
            Self::Time => f.write_str(", it is a time in seconds"),
            Self::TimeUpTo(most) => write!(f, ", expected a time above 0 s, at most {most} s"),
            Self::GapUpTo(most) => write!(f, ", at most {most} s can be bridged"),
            Self::Between(least, most) => {
                write!(f, ", it must be above {least} and below {most} degrees")
            }
            Self::SpeedScale => {
                let (least, most) = (SPEED_SCALES.start(), SPEED_SCALES.end());
                write!(
                    f,
                    ", expected {least} to {most} (a unit is converted, not scaled)"
                )
            }
        }
    }
}

fn there_are(frames: &[String]) -> String {
    match frames {
        [] => "the bag has no transforms of frames".to_owned(),
        names => format!("there are {}", names.join(", ")),
    }
}
