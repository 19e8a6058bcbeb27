//! What is wrong with the columns of a table.

use super::array::SegmentProblem;
use super::pose::PoseFileProblem;
use deepfusion_hint::count_of;
use std::fmt;

/// A measured quantity that needs a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// A speed.
    Speed,
    /// A rate of turn about the vertical axis.
    YawRate,
    /// An acceleration.
    Acceleration,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Speed => "speed",
            Self::YawRate => "yaw rate",
            Self::Acceleration => "acceleration",
        })
    }
}

/// What is wrong with a table, a list or an array, or is missing from it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColumnsProblem {
    /// The file has no header.
    #[error("the file is empty")]
    Empty {
        /// An example of a valid header.
        example: &'static str,
    },
    /// A required column is missing.
    #[error("no column '{wanted}', only {}", found.join(", "))]
    NoColumn {
        /// Its name.
        wanted: String,
        /// The names of the columns found.
        found: Vec<String>,
        /// An example of a valid header.
        example: &'static str,
    },
    /// The table ends after its header.
    #[error("no row below the header")]
    NoRows,
    /// The unit of a column of times is missing.
    #[error("column {column}: no unit of time is given")]
    NoTimeUnit {
        /// Name of the column.
        column: String,
    },
    /// The unit of a list of times is missing.
    #[error("the unit of its times is not given")]
    NoUnitOfTimes,
    /// The unit of a column of measured values is missing.
    #[error("column {column}: no unit of {quantity} is given")]
    NoUnit {
        /// What is measured.
        quantity: Quantity,
        /// Name of the column.
        column: String,
    },
    /// The unit is unknown.
    #[error("unknown unit of {quantity} '{unit}'")]
    UnknownUnit {
        /// What is measured.
        quantity: Quantity,
        /// The unit, as written.
        unit: String,
    },
    /// The unit of a folder of depth images is missing.
    #[error("the unit of the depth images is not given")]
    NoDepthUnit,
    /// The number of times differs from the number of images.
    #[error("{}, but there {} {}", count_of(*times, "time"), is_or_are(*images), count_of(*images, "image"))]
    TimesOfImages {
        /// Number of times.
        times: usize,
        /// Number of images.
        images: usize,
    },
    /// An array of a comma2k19 segment has invalid values.
    #[error(transparent)]
    Segment(#[from] SegmentProblem),
    /// A pose file does not contain a pose.
    #[error(transparent)]
    Pose(#[from] PoseFileProblem),
}

/// The verb for a count.
fn is_or_are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

impl ColumnsProblem {
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::Empty { example } | Self::NoColumn { example, .. } => {
                return format!(
                    "write the names of the columns in the first line, such as {example}"
                );
            }
            Self::NoRows => "add a row for each measurement",
            Self::NoTimeUnit { .. } => {
                "name the column time_s, time_ms, time_us or time_ns, or set time_unit in dataset.toml"
            }
            Self::NoUnitOfTimes => "set time_unit in dataset.toml: s, ms, us or ns",
            Self::UnknownUnit {
                quantity: Quantity::Speed,
                ..
            } => "use mps (m/s), kmh (km/h) or mph",
            Self::NoUnit { quantity, .. } | Self::UnknownUnit { quantity, .. } => match quantity {
                Quantity::Speed => {
                    "name the column speed_mps, speed_kmh or speed_mph, or set speed_unit in dataset.toml (a wrong unit would scale all \
                     depths)"
                }
                Quantity::YawRate => {
                    "name the column yaw_rate_radps or yaw_rate_dps (positive to the left), or set yaw_rate_unit \
                     in dataset.toml"
                }
                Quantity::Acceleration => {
                    "name the columns accel_x_mps2, accel_y_mps2, accel_z_mps2 (gravity included), or end them in _g"
                }
            },
            Self::NoDepthUnit => {
                "set depth_unit_m in dataset.toml: 0.001 for millimetres, 0.00390625 for KITTI's 1/256 m"
            }
            Self::TimesOfImages { .. } => {
                "write one line per image, in the order of their names, or use frames.csv, which names each image"
            }
            Self::Segment(_) => {
                "fetch the segment again: the file should be a NumPy array of numbers"
            }
            Self::Pose(_) => {
                "repair the file (world_from_cam in four rows of four numbers), or delete it"
            }
        };
        text.to_owned()
    }
}
