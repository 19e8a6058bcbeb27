//! Depth metrics and the field's evaluation protocol, on plain arrays.
//!
//! For each image, pass a [`Prediction`] (depth or disparity, of any size) and a ground-truth [`Grid`] to [`Evaluator::add`].
//! [`Evaluator::report`] then gives the [`Report`]: its JSON is for scripts, its `Display` is a table for people. [`MeanDepthBaseline`]
//! gives the score that any useful network must beat: that of the mean depth of each pixel over the training scans. If the ground truth is
//! dense, [`Sharpness`] measures how sharp boundaries are. [`odometry`] compares the camera's trajectories, [`verdict`] evaluates depth
//! without ground truth, and [`compare`] puts evaluations next to each other and to the field's published tables.
//!
//! # Conventions
//! Depth is camera z in metres. Ground truth of 0 (or NaN, or negative) means none, infinity means beyond every range. Disparity is 1/depth
//! in 1/m. Arrays are H×W, row by row. All arithmetic is in `f64`, whatever number type the files contain.

mod array_set;
pub mod compare;
mod error;
mod evaluator;
mod grid;
mod holes;
mod intervals;
mod mean_depth_baseline;
mod metrics;
pub mod odometry;
mod points;
mod points_table;
mod post_process;
mod protocol;
mod report;
mod resample;
mod sharpness;
mod statistics;
mod table;
pub mod verdict;

pub use deepfusion_fs::FileError;

pub use array_set::{ArraySet, match_names};
pub use error::{
    ArrayName, ArrayProblem, Error, ExpectedProtocolSetting, ExpectedShape, IntervalsProblem,
    LEVELS, Result,
};
pub use evaluator::{Evaluator, ImageScore, Sample};
pub use grid::{Grid, Prediction};
pub use intervals::{
    FactorRange, IntervalFactors, IntervalRange, IntervalRow, IntervalSample, Intervals,
};
pub use mean_depth_baseline::MeanDepthBaseline;
pub use metrics::Metrics;
pub use points::{DrawnPoint, PointErrors, PointRange, Points};
pub use points_table::points_csv;
pub use post_process::PostProcess;
pub use protocol::{Crop, GroundTruth, Holes, Protocol, Scaling};
pub use report::{
    FixedScaled, MeanDepthRow, ProtocolSummary, RangeBin, Report, Scale, ScenarioRow,
};
pub use sharpness::{BoundaryError, ImageSharpness, Sharpness};
pub use statistics::median;
