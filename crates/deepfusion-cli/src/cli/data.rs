use std::path::PathBuf;

use clap::{Args, Subcommand};
use deepfusion_data::{Cameras, GtKind, NamedTopic};
use deepfusion_logs::SpeedUnit;
use deepfusion_rosbag::Compression;

use super::values::{ClockOffset, hfov};
use super::{CameraIntrinsics, names};

/// `deepfusion data …`.
#[derive(Debug, Subcommand)]
pub(crate) enum DataCommand {
    /// What is in a recording: streams, rates, gaps, intrinsics, speeds, usable pairs.
    Inspect(InspectArgs),
    /// Write sparse ground-truth depth from the scans as an .npz file.
    ExportGt(ExportGtArgs),
    /// Write a recording in another layout: a KITTI drive, or a ROS 1 bag.
    Convert(ConvertArgs),
    /// Put a log of speeds beside its video: GPS tracks, OBD apps, phones, GoPro, CAN traces, any table.
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
    /// A recording: KITTI drive, date or root, KITTI odometry, KITTI-360, nuScenes, bag, image folder, video, comma2k19 or RGB-D folder.
    pub path: PathBuf,
    /// The camera, where the recording has no calibration, in pixels.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics")]
    pub hfov: Option<f64>,
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Also draw the measured depth on the images that have some.
    #[arg(long)]
    pub overlay: bool,
    /// Folder for the pictures of --overlay [default: runs/inspect-TIME].
    #[arg(long, value_name = "DIR", requires = "overlay")]
    pub out: Option<PathBuf>,
    /// Of a bag, also write the file beside it (BAG.toml): the topics and where the sensors are, as they were found, to correct and
    /// to complete. Of the options --topic, --intrinsics, --hfov and --clock-offset go into it.
    #[arg(long)]
    pub write_config: bool,
    /// Replace the file that --write-config finds there: its keys are kept, its comments are not.
    #[arg(long, requires = "write_config")]
    pub overwrite: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data convert`.
#[derive(Debug, Args)]
#[command(
    after_help = "Images are written undistorted, the measured depth as points seen from the camera.\n\n\
    Examples:\n  deepfusion data convert drive.bag kitti-drive\n  \
    deepfusion data convert kitti/2011_09_26/2011_09_26_drive_0005_sync drive.bag"
)]
pub(crate) struct ConvertArgs {
    /// A recording of any layout.
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// A new folder for a KITTI date, or a new file that ends in .bag.
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// The camera of a recording without a calibration, in pixels of its images.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with = "intrinsics")]
    pub hfov: Option<f64>,
    /// Which camera.
    #[arg(long, value_name = "2|3", default_value = "2")]
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Compression of a bag.
    #[arg(long, value_parser = names::compression(), default_value = "lz4")]
    pub compression: Compression,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion data import`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes speed.csv, imu.csv where the log has turns (course.csv where positions alone show them), and dataset.toml; the video stays where it is. A speed without a unit \
    is an error, never a guess.\n\n\
    Examples:\n  deepfusion data import track.gpx --video drive.mp4 --out my-drive\n  \
    deepfusion data import GX010042.MP4 --out my-drive   # a GoPro's own GPS and gyroscope\n  \
    deepfusion data import trackLog.csv --zone +02:00 --video drive.mp4 --out my-drive   # Torque\n  \
    deepfusion data import table.csv --time Zeit --speed Tempo --unit km/h --start 12:00:03 --video drive.mp4 --out my-drive\n  \
    deepfusion data import trace.blf --dbc car.dbc --speed Wheels.Speed --start 1.5 --video drive.mp4 --out my-drive"
)]
pub(crate) struct ImportArgs {
    /// The log: a file, or a phone app's export folder. Of several the first gives the speeds, the first that has turns the turns.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// The video [default: the log itself where it is a GoPro's].
    #[arg(long, value_name = "FILE", conflicts_with = "images")]
    pub video: Option<PathBuf>,
    /// The folder of images, in place of a video.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// A new folder, or one without speed.csv, imu.csv, course.csv and dataset.toml.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The column of times [default: by its name].
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// The column of speeds, or the signal of a CAN trace [default: by its name].
    #[arg(long, value_name = "COLUMN")]
    pub speed: Option<String>,
    /// The unit of speeds that do not say it: m/s, km/h, mph, knots.
    #[arg(long, value_name = "UNIT")]
    pub unit: Option<SpeedUnit>,
    /// What the frames of a CAN trace hold.
    #[arg(long, value_name = "FILE")]
    pub dbc: Option<PathBuf>,
    /// When the first frame was taken, on the log's clock: seconds, a date or a time of day [default: as the video's recorder says].
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub start: Option<String>,
    /// How far dates without a zone are ahead of UTC, such as +02:00 [default: not at all].
    #[arg(long, value_name = "HH:MM", value_parser = zone, allow_hyphen_values = true)]
    pub zone: Option<i64>,
    /// The camera's clock is so many milliseconds ahead of the log's, or `auto`: measured by how the pictures turn as the vehicle
    /// does, refused where they do not show it. It is written into dataset.toml [default: not at all].
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
    /// The camera in pixels of its images.
    #[arg(long, allow_hyphen_values = true, value_name = "fx,fy,cx,cy")]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with_all = ["intrinsics", "calibration"])]
    pub hfov: Option<f64>,
    /// Print what was understood as JSON.
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
    after_help = "One H×W array of f32 metres a frame, 0 = none, named 0000000005, or <drive>/0000000005 where \
    several drives are given. Where the LiDAR measured radial velocities, velocity_mps/0000000005 beside it: m/s over \
    ground along the ray, receding is positive, NaN = none.\n\n\
    Example:\n  deepfusion data export-gt kitti --split eigen/test_files.txt --out gt.npz"
)]
pub(crate) struct ExportGtArgs {
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
        allow_negative_numbers = true
    )]
    pub clock_offset: Option<ClockOffset>,
    /// Replace the file if it is there.
    #[arg(long)]
    pub overwrite: bool,
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
}
