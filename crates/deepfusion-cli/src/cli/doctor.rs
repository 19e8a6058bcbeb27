use std::path::PathBuf;

use clap::Args;
use deepfusion_data::NamedTopic;
use deepfusion_logs::SpeedUnit;

use super::CameraIntrinsics;
use super::device::device;
use super::values::{ClockOffset, hfov};
use crate::devices::ComputeDevice;

/// `deepfusion doctor`.
#[derive(Debug, Args)]
#[command(
    after_help = "Without a path, it shows processor, memory, GPU backends, ffmpeg, ONNX Runtime and free disk space.\n\
    The exit code is 1 if there is an error, and 0 if there are only warnings.\n\n\
    Examples:\n  deepfusion doctor\n  deepfusion doctor kitti/2011_09_26/2011_09_26_drive_0005_sync\n  \
    deepfusion doctor drive.bag --report drive.html\n  deepfusion doctor track.gpx\n  \
    deepfusion doctor trace.blf --dbc car.dbc --speed Wheels.Speed\n  deepfusion doctor --device cuda"
)]
pub(crate) struct DoctorArgs {
    /// Recording to check, or a speed log by itself, as `data import` reads it.
    ///
    /// A recording is a KITTI drive, date or root, KITTI odometry, KITTI-360, nuScenes, a bag, a folder of images, a video or a comma2k19
    /// segment.
    pub path: Option<PathBuf>,
    /// Camera intrinsics in pixels of the images, for a recording without a calibration.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "fx,fy,cx,cy",
        requires = "path"
    )]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics", requires = "path")]
    pub hfov: Option<f64>,
    /// For bags: which topic to use for a role, if several match; may be repeated.
    ///
    /// Roles are image, camera_info, lidar, dynamic, imu, speed, steering, can and truth.
    #[arg(long = "topic", value_name = "ROLE=NAME", requires = "path")]
    pub topics: Vec<NamedTopic>,
    /// How many milliseconds the camera's clock is ahead of the vehicle's, or `auto` [default: the recording's clock.camera_ahead_s].
    ///
    /// `auto` measures the offset from how the images turn when the vehicle turns. If the images do not show it, that is an error.
    #[arg(
        long = "clock-offset",
        alias = "clock",
        value_name = "MS|auto",
        allow_negative_numbers = true,
        requires = "path"
    )]
    pub clock_offset: Option<ClockOffset>,
    /// For a log by itself: column of times [default: found by its name].
    #[arg(long, value_name = "COLUMN", requires = "path")]
    pub time: Option<String>,
    /// For a log by itself: column of speeds, or signal of a CAN trace [default: found by its name].
    #[arg(long, value_name = "COLUMN", requires = "path")]
    pub speed: Option<String>,
    /// For a log by itself: unit of the speeds, if it does not state one: m/s, km/h, mph, knots.
    #[arg(long, value_name = "UNIT", requires = "path")]
    pub unit: Option<SpeedUnit>,
    /// For a CAN trace by itself: DBC file, what its frames contain.
    #[arg(long, value_name = "FILE", requires = "path")]
    pub dbc: Option<PathBuf>,
    /// Check a device instead of a recording: compare its results with the processor's.
    ///
    /// Every operation that networks and losses are made of is computed on both. If results differ, the exit code is 1, and the output says
    /// how to do without.
    #[arg(long, value_parser = device(), conflicts_with = "path")]
    pub device: Option<ComputeDevice>,
    /// Check the operations from this one on, with a line of JSON for each: for the process that a driver may crash.
    #[arg(long, value_name = "NAME", requires = "device", hide = true)]
    pub operations_from: Option<String>,
    /// Also write a page with plots over time and measured depth on images.
    #[arg(long, value_name = "FILE.html", requires = "path")]
    pub report: Option<PathBuf>,
    /// Replace an existing page.
    #[arg(long, requires = "report")]
    pub overwrite: bool,
    /// Also print every measured figure.
    #[arg(long, short, requires = "path")]
    pub verbose: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
