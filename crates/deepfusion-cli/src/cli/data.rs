use std::path::PathBuf;

use clap::{Args, Subcommand};
use deepfusion_data::{Cameras, GtKind};
use deepfusion_rosbag::Compression;

use super::values::milliseconds;
use super::{CameraIntrinsics, names};

/// `deepfusion data …`.
#[derive(Debug, Subcommand)]
pub enum DataCommand {
    /// What is in a recording: streams, rates, gaps, intrinsics, speeds, usable pairs.
    Inspect(InspectArgs),
    /// Write sparse ground-truth depth from the scans as an .npz file.
    ExportGt(ExportGtArgs),
    /// Write a recording in another layout: a KITTI drive, or a ROS 1 bag.
    Convert(ConvertArgs),
}

/// `deepfusion data inspect`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  deepfusion data inspect kitti/2011_09_26/2011_09_26_drive_0005_sync\n  \
    deepfusion data inspect kitti/2011_09_26 --overlay --out overlays\n  \
    deepfusion data inspect drive.mp4   # with speed.csv and calibration.yaml beside it"
)]
pub struct InspectArgs {
    /// A recording: KITTI drive, date or root, image folder, video, comma2k19 or RGB-D folder.
    pub path: PathBuf,
    /// The camera, where the recording has no calibration, in pixels.
    #[arg(long, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera's clock is so many milliseconds ahead of the vehicle's [default: the recording's clock.camera_ahead_s].
    #[arg(long = "clock-offset", value_name = "MS", value_parser = milliseconds, allow_negative_numbers = true)]
    pub camera_ahead_s: Option<f64>,
    /// Also draw the measured depth on the images that have some.
    #[arg(long)]
    pub overlay: bool,
    /// Folder for the pictures of --overlay [default: runs/inspect-TIME].
    #[arg(long, value_name = "DIR", requires = "overlay")]
    pub out: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data convert`.
#[derive(Debug, Args)]
#[command(
    after_help = "Images are written freed of their lens' distortion, the measured depth as points in the camera's place.\n\n\
    Examples:\n  deepfusion data convert drive.bag kitti-drive\n  \
    deepfusion data convert kitti/2011_09_26/2011_09_26_drive_0005_sync drive.bag"
)]
pub struct ConvertArgs {
    /// A recording of any layout.
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// A new folder for a KITTI date, or a new file that ends in .bag.
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// The camera of a recording without a calibration, in pixels of its images.
    #[arg(long, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Which camera.
    #[arg(long, value_name = "2|3", default_value = "2")]
    pub camera: Cameras,
    /// The camera's clock is so many milliseconds ahead of the vehicle's [default: the recording's clock.camera_ahead_s].
    #[arg(long = "clock-offset", value_name = "MS", value_parser = milliseconds, allow_negative_numbers = true)]
    pub camera_ahead_s: Option<f64>,
    /// Compression of a bag.
    #[arg(long, value_parser = names::compression(), default_value = "lz4")]
    pub compression: Compression,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data export-gt`.
#[derive(Debug, Args)]
#[command(
    after_help = "One H×W array of f32 metres a frame, 0 = none, named 0000000005, or <drive>/0000000005 where \
    several drives are given. Where the LiDAR measured radial velocities, velocity_mps/0000000005 beside it: m/s over \
    ground along the ray, receding is positive, NaN = none.\n\n\
    Example:\n  deepfusion data export-gt kitti --split eigen/test_files.txt --out gt.npz"
)]
pub struct ExportGtArgs {
    /// Recordings with scans or depth images.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Only the frames of this split file (lines "folder index side").
    #[arg(long, value_name = "FILE")]
    pub split: Option<PathBuf>,
    /// Fail unless every frame of --split is there and has ground truth.
    #[arg(long, requires = "split")]
    pub strict: bool,
    /// Which depth, at which pixel.
    #[arg(long, value_parser = names::gt_kind(), default_value = "z")]
    pub gt_depth: GtKind,
    /// Which camera.
    #[arg(long, value_name = "2|3|both", default_value = "2")]
    pub camera: Cameras,
    /// File to write.
    #[arg(long, value_name = "FILE.npz")]
    pub out: PathBuf,
    /// The camera's clock is so many milliseconds ahead of the vehicle's [default: the recording's clock.camera_ahead_s].
    #[arg(long = "clock-offset", value_name = "MS", value_parser = milliseconds, allow_negative_numbers = true)]
    pub camera_ahead_s: Option<f64>,
    /// Replace the file if it is there.
    #[arg(long)]
    pub overwrite: bool,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}
