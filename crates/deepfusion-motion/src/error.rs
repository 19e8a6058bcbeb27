//! What can go wrong while a vehicle's sensors are read and fused.

mod array;
mod expected;

pub use self::array::{ArrayProblem, TimesArray};
pub use self::expected::{ExpectedLayout, ExpectedSetting};

use deepfusion_hint::{Hint, system_hint};
use std::path::{Path, PathBuf};

/// Number of names that an error lists.
const NAMES_SHOWN: usize = 12;

/// What can go wrong while a vehicle's sensors are read and fused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting that no vehicle or sensor has.
    #[error("{field} is {value}: expected {expected}")]
    Config {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
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
        /// How many can be used.
        usable: usize,
        /// How many there are.
        total: usize,
        /// How many are needed.
        needed: usize,
    },
    /// What the accelerometer measures on average is not gravity.
    #[error(
        "imu: the mean specific force is {norm:.2} m/s² ({:.2}, {:.2}, {:.2} forward, left, up), expected about 9.81",
        found[0], found[1], found[2]
    )]
    NotGravity {
        /// Its mean, in vehicle axes, m/s².
        found: [f64; 3],
        /// Its length, m/s².
        norm: f64,
    },
    /// Gravity points elsewhere than down.
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
        /// How long the vehicle turned, in seconds.
        turning_s: f64,
    },
    /// A file could not be opened or read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An array file is not what the recording's layout says.
    #[error("{}: {problem}", path.display())]
    Array {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: ArrayProblem,
    },
    /// A DBC file cannot be understood.
    #[error("DBC: {}{source}", of_file(path.as_deref()))]
    Dbc {
        /// The file; `None` for a text without one.
        path: Option<PathBuf>,
        /// What the parser said, with the line where it is known.
        source: Box<can_dbc::DbcError>,
    },
    /// There is no such signal.
    #[error("signal `{name}`: {problem}")]
    NoSignal {
        /// The name asked for, "Message.Signal".
        name: String,
        /// What there is instead.
        problem: SignalProblem,
    },
    /// A signal's layout does not fit into a frame.
    #[error("signal `{name}`: {field} is {value}, expected {expected}")]
    Layout {
        /// The signal.
        name: String,
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: ExpectedLayout,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    pub(crate) fn file(path: &Path, source: std::io::Error) -> Self {
        Self::File {
            path: path.to_owned(),
            source,
        }
    }
}

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
                    "check that the recording has the {stream} and that its time stamps run forward"
                ));
            }
            Self::NotGravity { norm, .. } if (0.8..1.25).contains(norm) => {
                "the accelerations look like multiples of g: multiply them by 9.80665"
            }
            Self::NotGravity { norm, .. } if *norm < 0.8 => {
                "gravity seems to have been removed already: give the raw accelerations, or leave the unit out"
            }
            Self::NotGravity { .. } => "give accelerations in m/s², gravity included",
            Self::NotUp { angle_deg, .. } if *angle_deg > 135.0 => {
                "the unit is mounted upside down, or counts z downward: turn vehicle_from_imu by 180° about x"
            }
            Self::NotUp { .. } => {
                "vehicle_from_imu takes the sensor's axes to x forward, y left, z up: correct its rotation"
            }
            Self::YawSigns { .. } => {
                "make the steering ratio negative where the angle grows to the right, or correct vehicle_from_imu"
            }
            Self::File { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                "a comma2k19 segment has processed_log/CAN, processed_log/IMU and global_pose"
            }
            Self::File { source, .. } => return Some(system_hint(source.kind()).into()),
            Self::Array { .. } => {
                "fetch the recording again: the file is cut off, or of another data set"
            }
            Self::Dbc { .. } => {
                "repair the line, or describe the signals you need by id, start bit and length instead"
            }
            Self::NoSignal { .. } => "names are \"Message.Signal\", as the DBC file spells them",
            Self::Layout { .. } => {
                "compare the signal's start bit, length and byte order with its documentation"
            }
        };
        Some(text.to_owned())
    }
}

/// Why a DBC file has no signal of a name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalProblem {
    /// It is no name of a signal.
    #[error("expected \"Message.Signal\"")]
    Name,
    /// There is no such message.
    #[error("no message `{message}`; there are {}", some_names(known))]
    NoMessage {
        /// The message's name.
        message: String,
        /// Those there are.
        known: Vec<String>,
    },
    /// The message has no such signal.
    #[error("`{message}` has {}", some_names(known))]
    NoSignal {
        /// The message's name.
        message: String,
        /// The signals it has.
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
