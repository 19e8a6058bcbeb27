use std::path::PathBuf;

use clap::{Args, Subcommand};
use deepfusion_data::{Cameras, GtKind, NamedTopic};
use deepfusion_logs::SpeedUnit;
use deepfusion_rosbag::Compression;

use super::values::{ClockOffset, file_ending_in, hfov};
use super::{CameraIntrinsics, names};

/// `deepfusion data …`.
#[derive(Debug, Subcommand)]
pub(crate) enum DataCommand {
    /// Show what is in a recording: streams, rates, gaps, intrinsics, speeds, usable pairs.
    Inspect(InspectArgs),
    /// Write sparse ground-truth depth from scans to an .npz file.
    ExportGt(ExportGtArgs),
    /// Convert a recording to another layout: a KITTI drive or a ROS 1 bag.
    Convert(ConvertArgs),
    /// Combine a speed log with its video: GPS tracks, OBD apps, phones, GoPro, CAN traces, any table.
    Import(ImportArgs),
}

/// `deepfusion data inspect`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  deepfusion data inspect kitti/2011_09_26/2011_09_26_drive_0005_sync\n  \
    deepfusion data inspect kitti/2011_09_26 --overlay --out overlays\n  \
    deepfusion data inspect drive.mp4   # with speed.csv and calibration.yaml beside it\n  \
    deepfusion data inspect drive.bag --topic image=/camera/front/image_raw --write-config"
)]
pub(crate) struct InspectArgs {
    /// Recording: KITTI drive, date or root, KITTI odometry, KITTI-360, nuScenes, bag, image folder, video, comma2k19 or RGB-D folder.
    pub path: PathBuf,
    /// Camera intrinsics in pixels, if the recording has no calibration.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics")]
    pub hfov: Option<f64>,
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Also draw the measured depth on the images that have any.
    #[arg(long)]
    pub overlay: bool,
    /// Folder for the pictures of --overlay [default: runs/inspect-TIME].
    #[arg(long, value_name = "DIR", requires = "overlay")]
    pub out: Option<PathBuf>,
    /// For a bag, also write the file beside it (BAG.toml), for you to correct and complete.
    ///
    /// It holds the topics and sensor poses that were found, and the values of --topic, --intrinsics, --hfov and --clock-offset.
    #[arg(long)]
    pub write_config: bool,
    /// Replace the file that --write-config finds there; its keys are kept, its comments are not.
    #[arg(long, requires = "write_config")]
    pub overwrite: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data convert`.
#[derive(Debug, Args)]
#[command(
    after_help = "Images are written undistorted, measured depth as points seen from the camera.\n\n\
    Examples:\n  deepfusion data convert drive.bag kitti-drive\n  \
    deepfusion data convert kitti/2011_09_26/2011_09_26_drive_0005_sync drive.bag"
)]
pub(crate) struct ConvertArgs {
    /// Recording of any layout.
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// New folder for a KITTI date, or new file that ends in .bag.
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// Camera intrinsics in pixels of the images, for a recording without a calibration.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics")]
    pub hfov: Option<f64>,
    /// Which camera to use.
    #[arg(long, value_name = "2|3", default_value = "2")]
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Compression of the bag.
    #[arg(long, value_parser = names::compression(), default_value = "lz4")]
    pub compression: Compression,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data import`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes speed.csv, dataset.toml and, if the log has turns, imu.csv (course.csv if only its positions show them). The video stays \
    where it is. A speed without a unit is an error: units are never guessed.\n\n\
    Examples:\n  deepfusion data import track.gpx --video drive.mp4 --out my-drive\n  \
    deepfusion data import GX010042.MP4 --out my-drive   # a GoPro's own GPS and gyroscope\n  \
    deepfusion data import trackLog.csv --zone +02:00 --video drive.mp4 --out my-drive   # Torque\n  \
    deepfusion data import table.csv --time Zeit --speed Tempo --unit km/h --start 12:00:03 --video drive.mp4 --out my-drive\n  \
    deepfusion data import trace.blf --dbc car.dbc --speed Wheels.Speed --start 1.5 --video drive.mp4 --out my-drive"
)]
pub(crate) struct ImportArgs {
    /// Log: a file, or the export folder of a phone app.
    ///
    /// With several logs, the speeds come from the first, and the turns from the first that has any.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Video [default: the log itself, if it is a GoPro's].
    #[arg(long, value_name = "FILE", conflicts_with = "images")]
    pub video: Option<PathBuf>,
    /// Folder of images, instead of a video.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Output folder: new, or without speed.csv, imu.csv, course.csv and dataset.toml.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Column of times [default: found by its name].
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// Column of speeds, or signal of a CAN trace [default: found by its name].
    #[arg(long, value_name = "COLUMN")]
    pub speed: Option<String>,
    /// Unit of the speeds, if the log does not state it: m/s, km/h, mph, knots.
    #[arg(long, value_name = "UNIT")]
    pub unit: Option<SpeedUnit>,
    /// DBC file: what the frames of a CAN trace contain.
    #[arg(long, value_name = "FILE")]
    pub dbc: Option<PathBuf>,
    /// When the first frame was taken, by the log's clock: seconds, a date or a time of day [default: what the video's recorder wrote].
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub start: Option<String>,
    /// Time zone of dates that do not state one, as an offset from UTC, such as +02:00 [default: UTC].
    #[arg(long, value_name = "HH:MM", value_parser = zone, allow_hyphen_values = true)]
    pub zone: Option<i64>,
    /// How many milliseconds the camera's clock is ahead of the log's, or `auto`; written into dataset.toml [default: 0].
    ///
    /// `auto` measures the offset from how the images turn when the vehicle turns. If the images do not show it, that is an error.
    #[arg(
        long = "clock-offset",
        alias = "clock",
        value_name = "MS|auto",
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// The camera's calibration file.
    #[arg(long, value_name = "FILE", conflicts_with = "intrinsics")]
    pub calibration: Option<PathBuf>,
    /// Camera intrinsics in pixels of the images.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with_all = ["intrinsics", "calibration"])]
    pub hfov: Option<f64>,
    /// Print how the log was understood, as JSON.
    #[arg(long)]
    pub json: bool,
}

/// "+02:00", "-5" as seconds.
fn zone(word: &str) -> Result<i64, String> {
    let (sign, digits) = match word.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, word.strip_prefix('+').unwrap_or(word)),
    };
    let (hours, minutes) = digits.split_once(':').unwrap_or((digits, "0"));
    let numbers = (hours.parse::<i64>(), minutes.parse::<i64>());
    match numbers {
        (Ok(hours @ 0..=14), Ok(minutes @ 0..60)) => Ok(sign * (hours * 3600 + minutes * 60)),
        _ => Err("expected a zone such as +02:00 or -5".into()),
    }
}

/// `deepfusion data export-gt`.
#[derive(Debug, Args)]
#[command(
    after_help = "The file has one H×W array per frame (f32 metres, 0 = no depth), named 0000000005, or <drive>/0000000005 if there are several \
    drives. If the LiDAR measured radial velocities, velocity_mps/0000000005 is beside it: m/s over ground along the ray, positive \
    if receding, NaN = none.\n\n\
    Example:\n  deepfusion data export-gt kitti --split eigen/test_files.txt --out gt.npz"
)]
pub(crate) struct ExportGtArgs {
    /// Recordings with scans or depth images.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Use only the frames of this split file (lines "folder index side").
    #[arg(long, value_name = "FILE")]
    pub split: Option<PathBuf>,
    /// Fail unless every frame of --split exists and has ground truth.
    #[arg(long, requires = "split")]
    pub strict: bool,
    /// Convention of the ground truth: which depth, at which pixel.
    #[arg(long, value_parser = names::gt_kind(), default_value = "z")]
    pub gt_depth: GtKind,
    /// Which camera to use.
    #[arg(long, value_name = "2|3|both", default_value = "2")]
    pub camera: Cameras,
    /// File to write.
    #[arg(long, value_name = "FILE.npz", value_parser = file_ending_in("npz"))]
    pub out: PathBuf,
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}
