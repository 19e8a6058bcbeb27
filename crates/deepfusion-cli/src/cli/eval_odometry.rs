use std::path::PathBuf;

use clap::{ArgGroup, Args};
use deepfusion_data::{Cameras, NamedTopic};

use super::device::device;
use super::values::ClockOffset;
use crate::devices::ComputeDevice;

/// `deepfusion eval-odometry`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("what").required(true).args(["model", "pred"])),
    after_help = "All results are unscaled. Drift is KITTI's t_rel and r_rel over 100 to 800 m, or over 10 to 50 m on shorter drives; ATE is over \
    five frames. Ground truth is the simulator's exact poses or the recording's own; for KITTI raw it is the path integrated from \
    OXTS. A pose file has one pose of the camera in the world per line: KITTI's 12 numbers or TUM's 8 (time tx ty tz qx qy qz qw).\n\n\
    Examples:\n  deepfusion eval-odometry --model runs/train-1 --data kitti/2011_09_26 --out odometry\n  \
    deepfusion eval-odometry --pred 09.txt --gt poses/09.txt --json"
)]
pub(crate) struct EvalOdometryArgs {
    /// Run folder, or checkpoint in it.
    #[arg(long, value_name = "RUN", requires = "data")]
    pub model: Option<PathBuf>,
    /// Data set whose metric scale to use, for a run trained on several.
    #[arg(
        long = "data-set",
        alias = "set",
        value_name = "NAME",
        conflicts_with = "pred"
    )]
    pub set: Option<String>,
    /// Recordings to evaluate on: KITTI (raw, odometry, 360) drives or roots, nuScenes, RGB-D folders, bags with exact motion.
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "pred")]
    pub data: Vec<PathBuf>,
    /// Which camera to use.
    #[arg(
        long,
        value_name = "2|3|both",
        default_value = "2",
        conflicts_with = "pred"
    )]
    pub camera: Cameras,
    /// For bags: which topic to use for a role, if several match; may be repeated.
    ///
    /// Roles are image, camera_info, lidar, dynamic, imu, speed, steering, can and truth.
    #[arg(long = "topic", value_name = "ROLE=NAME")]
    pub topics: Vec<NamedTopic>,
    /// How many milliseconds the camera's clock is ahead of the vehicle's, or `auto` [default: the recording's clock.camera_ahead_s].
    ///
    /// `auto` measures the offset from how the images turn when the vehicle turns. If the images do not show it, that is an error.
    #[arg(
        long = "clock-offset",
        alias = "clock",
        value_name = "MS|auto",
        allow_negative_numbers = true,
        conflicts_with = "pred"
    )]
    pub clock_offset: Option<ClockOffset>,
    /// File of predicted poses.
    #[arg(long, value_name = "FILE", requires = "gt")]
    pub pred: Option<PathBuf>,
    /// File of true poses.
    #[arg(long, value_name = "FILE", requires = "pred")]
    pub gt: Option<PathBuf>,
    /// Folder for both trajectories as KITTI and TUM files, and a picture of them from above.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
