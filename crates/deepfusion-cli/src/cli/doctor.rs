use std::path::PathBuf;

use clap::Args;

use super::CameraIntrinsics;
use super::values::{hfov, milliseconds};

/// `deepfusion doctor`.
#[derive(Debug, Args)]
#[command(
    after_help = "Without a path: processor, memory, GPU backends, ffmpeg, ONNX Runtime, free disk space.\n\
    The exit code is 1 where there is an error, 0 with warnings alone.\n\n\
    Examples:\n  deepfusion doctor\n  deepfusion doctor kitti/2011_09_26/2011_09_26_drive_0005_sync\n  \
    deepfusion doctor drive.bag --report drive.html"
)]
pub struct DoctorArgs {
    /// A recording: a KITTI drive, date or root, a bag, a folder of images, a video, a comma2k19 segment.
    pub path: Option<PathBuf>,
    /// The camera of a recording without a calibration, in pixels of its images.
    #[arg(long, value_name = "fx,fy,cx,cy", requires = "path")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics", requires = "path")]
    pub hfov: Option<f64>,
    /// The camera's clock is so many milliseconds ahead of the vehicle's [default: the recording's clock.camera_ahead_s].
    #[arg(long = "clock-offset", value_name = "MS", value_parser = milliseconds, allow_negative_numbers = true, requires = "path")]
    pub camera_ahead_s: Option<f64>,
    /// Also write a page with plots over time and measured depth on images.
    #[arg(long, value_name = "FILE.html", requires = "path")]
    pub report: Option<PathBuf>,
    /// Also tell every figure that was measured.
    #[arg(long, short, requires = "path")]
    pub verbose: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
