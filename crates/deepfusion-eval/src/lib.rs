//! Depth metrics and the field's evaluation protocol, on plain arrays.
//!
//! The way of an image: a [`Prediction`] (depth or disparity, any size) and a ground truth [`Grid`] go into
//! [`Evaluator::add`]; [`Evaluator::report`] gives the [`Report`], whose JSON is the one scripts rely on and whose
//! `Display` is the table for people. [`MeanDepthBaseline`] makes the row that any useful network must beat: the mean
//! depth of each pixel over the training scans. Where truth is dense, [`Sharpness`] says how sharp boundaries are. Paths of
//! the camera are compared in [`odometry`]; what a drive says without any truth is in [`verdict`]; [`compare`] puts evaluations side by side, and beside the field's published tables.
//!
//! # Conventions
//! Depth is camera z in metres; ground truth 0 (or NaN, or negative) means none, infinity what is
//! beyond every range. Disparity is 1/depth in 1/m. Arrays are
//! H×W, row by row. All arithmetic is in `f64`, whatever the files hold.

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
