//! What can go wrong when a vehicle's sensors are read and fused.

mod array;
mod dbc;
mod expected;

pub use self::array::{ArrayProblem, TimesArray};
pub use self::dbc::DbcProblem;
pub use self::expected::{ExpectedLayout, ExpectedSetting};

use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use std::path::{Path, PathBuf};

/// Number of names that an error message lists.
const NAMES_SHOWN: usize = 12;

/// What can go wrong when a vehicle's sensors are read and fused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting with an implausible value.
    #[error("{field} is {value}, expected {expected}")]
    Config {
        /// Name of the setting.
        field: &'static str,
        /// The setting's value.
        value: f64,
        /// What the value must be.
        expected: ExpectedSetting,
    },
    /// A stream has too few usable samples.
    #[error(
        "{stream}: {} of {total} (finite, and later than the one before), expected at least {needed}",
        deepfusion_hint::count_of(*usable, "usable sample")
    )]
    TooFewSamples {
        /// The stream: "speed", "imu", …
        stream: &'static str,
        /// Number of usable samples.
        usable: usize,
        /// Number of samples.
        total: usize,
        /// Number of samples needed.
        needed: usize,
    },
    /// The accelerometer's mean is not gravity.
    #[error(
        "imu: the mean specific force is {norm:.2} m/s² ({:.2}, {:.2}, {:.2} forward, left, up), expected about 9.81",
        found[0], found[1], found[2]
    )]
    NotGravity {
        /// Mean specific force, in vehicle axes, m/s².
        found: [f64; 3],
        /// Norm of the mean, m/s².
        norm: f64,
    },
    /// Gravity does not point down in vehicle axes.
    #[error(
        "imu: up is measured {angle_deg:.0}° away from the vehicle's z axis \
         ({:.2}, {:.2}, {:.2} m/s² forward, left, up): vehicle_from_imu does not fit the sensor",
        found[0], found[1], found[2]
    )]
    NotUp {
        /// The mean specific force, in vehicle axes, m/s².
        found: [f64; 3],
        /// Angle between it and the vehicle's z axis, in degrees.
        angle_deg: f64,
    },
    /// The gyro and the steering wheel turn in opposite directions.
    #[error(
        "imu and steering disagree about left and right: their yaw rates correlate at {correlation:.2} over {turning_s:.0} s of turning"
    )]
    YawSigns {
        /// Correlation of the two yaw rates.
        correlation: f64,
        /// Duration of turning, in seconds.
        turning_s: f64,
    },
    /// A file could not be opened or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// An array of a comma2k19 segment does not exist or cannot be read.
    #[error(transparent)]
    ArrayFile(FileError),
    /// An array file does not match the recording's layout.
    #[error("{}: {problem}", path.display())]
    Array {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        problem: ArrayProblem,
    },
    /// A DBC file cannot be parsed.
    #[error("DBC: {}{problem}", of_file(path.as_deref()))]
    Dbc {
        /// Path of the file; `None` for a text without a file.
        path: Option<PathBuf>,
        /// Why it cannot be parsed.
        problem: DbcProblem,
    },
    /// A DBC file does not contain the signal.
    #[error("signal `{name}`: {problem}")]
    NoSignal {
        /// The name asked for, "Message.Signal".
        name: String,
        /// What is missing, and what exists instead.
        problem: SignalProblem,
    },
    /// A signal's layout does not fit into a frame.
    #[error("signal `{name}`: {field} is {value}, expected {expected}")]
    Layout {
        /// Name of the signal.
        name: String,
        /// Name of the field.
        field: &'static str,
        /// The field's value.
        value: f64,
        /// What the value must be.
        expected: ExpectedLayout,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn of_file(path: Option<&Path>) -> String {
    path.map_or_else(String::new, |path| format!("{}: ", path.display()))
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Config { field, .. } => {
                return Some(format!("correct {field} in the configuration"));
            }
            Self::TooFewSamples { stream, .. } => {
                return Some(format!(
                    "check that the recording contains {stream} samples and that their time stamps increase"
                ));
            }
            Self::NotGravity { norm, .. } if (0.8..1.25).contains(norm) => {
                "multiply the accelerations by 9.80665: they look like multiples of g"
            }
            Self::NotGravity { norm, .. } if *norm < 0.8 => {
                "give the raw accelerations, or leave out the unit: gravity seems to have been removed already"
            }
            Self::NotGravity { .. } => "give accelerations in m/s², gravity included",
            Self::NotUp { angle_deg, .. } if *angle_deg > 135.0 => {
                "rotate vehicle_from_imu by 180° about x: the unit is mounted upside down, or its z axis points down"
            }
            Self::NotUp { .. } => {
                "correct the rotation of vehicle_from_imu, which takes the sensor's axes to x forward, y left, z up"
            }
            Self::YawSigns { .. } => {
                "make the steering ratio negative if the angle grows to the right, or correct vehicle_from_imu"
            }
            Self::ArrayFile(FileError::NoSuchPath { .. }) => {
                "give a comma2k19 segment, a folder with processed_log/CAN, processed_log/IMU and global_pose"
            }
            Self::File(error) | Self::ArrayFile(error) => return error.hint(),
            Self::Array { .. } => {
                "download the recording again: the file is cut off, or from another data set"
            }
            Self::Dbc { .. } => {
                "correct the line, or describe the signals you need by id, start bit and length instead"
            }
            Self::NoSignal { .. } => "give \"Message.Signal\", spelt as in the DBC file",
            Self::Layout { .. } => {
                "compare the signal's start bit, length and byte order with its documentation"
            }
        };
        Some(text.to_owned())
    }
}

/// Why a signal is not in a DBC file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalProblem {
    /// The name does not have the form "Message.Signal".
    #[error("expected \"Message.Signal\"")]
    Name,
    /// There is no message of this name.
    #[error("no message `{message}`; the file has {}", some_names(known))]
    NoMessage {
        /// Name of the message.
        message: String,
        /// Names of the messages that exist.
        known: Vec<String>,
    },
    /// The message has no signal of this name.
    #[error("not in message `{message}`, which has {}", some_names(known))]
    NoSignal {
        /// Name of the message.
        message: String,
        /// Names of its signals.
        known: Vec<String>,
    },
}

fn some_names(names: &[String]) -> String {
    match names.split_at_checked(NAMES_SHOWN) {
        _ if names.is_empty() => "none".into(),
        Some((shown, more)) if !more.is_empty() => {
            format!("{} and {} more", shown.join(", "), more.len())
        }
        _ => names.join(", "),
    }
}
