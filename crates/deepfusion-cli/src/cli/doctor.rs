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
    after_help = "Without a path: processor, memory, GPU backends, ffmpeg, ONNX Runtime, free disk space.\n\
    The exit code is 1 where there is an error, 0 with warnings alone.\n\n\
    Examples:\n  deepfusion doctor\n  deepfusion doctor kitti/2011_09_26/2011_09_26_drive_0005_sync\n  \
    deepfusion doctor drive.bag --report drive.html\n  deepfusion doctor track.gpx\n  \
    deepfusion doctor trace.blf --dbc car.dbc --speed Wheels.Speed\n  deepfusion doctor --device cuda"
)]
pub(crate) struct DoctorArgs {
    /// A recording: a KITTI drive, date or root, KITTI odometry, KITTI-360, nuScenes, a bag, a folder of images, a video, a comma2k19
    /// segment. Or a log of speeds by itself, as `data import` reads it.
    pub path: Option<PathBuf>,
    /// The camera of a recording without a calibration, in pixels of its images.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "fx,fy,cx,cy",
        requires = "path"
    )]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics", requires = "path")]
    pub hfov: Option<f64>,
    /// For bags: the topic for a role, where several topics match (roles: image, camera_info, lidar, dynamic, imu, speed, steering,
    /// can, truth). May be repeated.
    #[arg(long = "topic", value_name = "ROLE=NAME", requires = "path")]
    pub topics: Vec<NamedTopic>,
    /// The camera's clock is so many milliseconds ahead of the vehicle's, or `auto`: measured by how the pictures turn as the vehicle
    /// does, refused where they do not show it [default: the recording's clock.camera_ahead_s].
    #[arg(
        long = "clock-offset",
        alias = "clock",
        value_name = "MS|auto",
        allow_negative_numbers = true,
        requires = "path"
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Of a log by itself: the column of times [default: by its name].
    #[arg(long, value_name = "COLUMN", requires = "path")]
    pub time: Option<String>,
    /// Of a log by itself: the column of speeds, or the signal of a CAN trace [default: by its name].
    #[arg(long, value_name = "COLUMN", requires = "path")]
    pub speed: Option<String>,
    /// Of a log by itself: the unit of speeds that do not say it: m/s, km/h, mph, knots.
    #[arg(long, value_name = "UNIT", requires = "path")]
    pub unit: Option<SpeedUnit>,
    /// Of a CAN trace by itself: what its frames hold.
    #[arg(long, value_name = "FILE", requires = "path")]
    pub dbc: Option<PathBuf>,
    /// Instead of a recording: compute everything that networks and losses are made of on this device and on the processor, and compare.
    /// The exit code is 1 where they differ, with what to do without.
    #[arg(long, value_parser = device(), conflicts_with = "path")]
    pub device: Option<ComputeDevice>,
    /// Those operations from this one on, a line of JSON each: what the process does that a driver may end.
    #[arg(long, value_name = "NAME", requires = "device", hide = true)]
    pub operations_from: Option<String>,
    /// Also write a page with plots over time and measured depth on images.
    #[arg(long, value_name = "FILE.html", requires = "path")]
    pub report: Option<PathBuf>,
    /// Replace the page if it is there.
    #[arg(long, requires = "report")]
    pub overwrite: bool,
    /// Also print every figure that was measured.
    #[arg(long, short, requires = "path")]
    pub verbose: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
