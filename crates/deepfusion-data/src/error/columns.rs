//! What is wrong with the columns of a table.

use super::array::SegmentProblem;
use super::pose::PoseFileProblem;
use deepfusion_hint::count_of;
use std::fmt;

/// What is measured, where its unit is in question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// A speed.
    Speed,
    /// A turn about the vertical axis by time.
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
    /// A column that is needed is missing.
    #[error("no column '{wanted}', there is: {}", found.join(", "))]
    NoColumn {
        /// Its name.
        wanted: String,
        /// The columns that there are.
        found: Vec<String>,
        /// A header that would do.
        example: &'static str,
    },
    /// It ends after its header.
    #[error("no row below the header")]
    NoRows,
    /// Nothing says the unit of a column of times.
    #[error("nothing says the unit of time of column {column}")]
    NoTimeUnit {
        /// The column.
        column: String,
    },
    /// Nothing says the unit of a list of times.
    #[error("nothing says the unit of its times")]
    NoUnitOfTimes,
    /// Nothing says the unit of a column of measured values.
    #[error("nothing says the unit of column {column}")]
    NoUnit {
        /// What is measured.
        quantity: Quantity,
        /// The column.
        column: String,
    },
    /// The unit is none that is known.
    #[error("the unit of {quantity} '{unit}' is not known")]
    UnknownUnit {
        /// What is measured.
        quantity: Quantity,
        /// The unit.
        unit: String,
    },
    /// Nothing says the unit of a folder of depth images.
    #[error("nothing says the unit of the depth images")]
    NoDepthUnit,
    /// There are more times than images, or fewer.
    #[error("{}, but there {} {}", count_of(*times, "time"), is_or_are(*images), count_of(*images, "image"))]
    TimesOfImages {
        /// How many times there are.
        times: usize,
        /// How many images.
        images: usize,
    },
    /// An array of a comma2k19 segment does not hold the values that it should.
    #[error(transparent)]
    Segment(#[from] SegmentProblem),
    /// A file of a pose does not hold one.
    #[error(transparent)]
    Pose(#[from] PoseFileProblem),
}

/// The verb of a count.
fn is_or_are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

impl ColumnsProblem {
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::NoColumn { example, .. } => {
                return format!("the first line names the columns, such as {example}");
            }
            Self::NoRows => "record some",
            Self::NoTimeUnit { .. } => {
                "name the column time_s, time_ms, time_us or time_ns, or set time_unit in dataset.toml"
            }
            Self::NoUnitOfTimes => "set time_unit in dataset.toml: s, ms, us or ns",
            Self::UnknownUnit {
                quantity: Quantity::Speed,
                ..
            } => "units are mps (m/s), kmh (km/h) and mph",
            Self::NoUnit { quantity, .. } | Self::UnknownUnit { quantity, .. } => match quantity {
                Quantity::Speed => {
                    "name the column speed_mps, speed_kmh or speed_mph, or set speed_unit in dataset.toml: \
                     a wrong unit would scale every depth"
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
                "it must have one line for each image, in order of their names; frames.csv names \
                 each image"
            }
            Self::Segment(_) => "fetch the segment again: it should be a NumPy array of numbers",
            Self::Pose(_) => {
                "a pose is world_from_cam in four rows of four numbers: repair it, or delete the file"
            }
        };
        text.to_owned()
    }
}
