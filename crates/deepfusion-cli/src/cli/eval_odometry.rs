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
    after_help = "Unscaled. Drift is KITTI's t_rel and r_rel over 100 to 800 m, on shorter drives over 10 to 50 m; ATE is over \
    five frames. Truth is the simulator's exact poses or the recording's own, of KITTI raw the path integrated from OXTS. Pose files: a line is a pose \
    of the camera in the world, KITTI's 12 numbers or TUM's 8 (time tx ty tz qx qy qz qw).\n\n\
    Examples:\n  deepfusion eval-odometry --model runs/train-1 --data kitti/2011_09_26 --out odometry\n  \
    deepfusion eval-odometry --pred 09.txt --gt poses/09.txt --json"
)]
pub(crate) struct EvalOdometryArgs {
    /// A run folder or a checkpoint in it.
    #[arg(long, value_name = "RUN", requires = "data")]
    pub model: Option<PathBuf>,
    /// The data set whose metric scale to use, for a run trained on several.
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
    /// Which camera.
    #[arg(
        long,
        value_name = "2|3|both",
        default_value = "2",
        conflicts_with = "pred"
    )]
    pub camera: Cameras,
    /// For bags: the topic for a role, where several topics match (roles: image, camera_info, lidar, dynamic, imu, speed, steering,
    /// can, truth). May be repeated.
    #[arg(long = "topic", value_name = "ROLE=NAME")]
    pub topics: Vec<NamedTopic>,
    /// The camera's clock is so many milliseconds ahead of the vehicle's, or `auto`: measured by how the pictures turn as the vehicle
    /// does, refused where they do not show it [default: the recording's clock.camera_ahead_s].
    #[arg(
        long = "clock-offset",
        alias = "clock",
        value_name = "MS|auto",
        allow_negative_numbers = true,
        conflicts_with = "pred"
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Predicted poses.
    #[arg(long, value_name = "FILE", requires = "gt")]
    pub pred: Option<PathBuf>,
    /// True poses.
    #[arg(long, value_name = "FILE", requires = "pred")]
    pub gt: Option<PathBuf>,
    /// Folder for both paths as KITTI and TUM files, and their picture from above.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where to compute; one of several GPUs by its index, as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
