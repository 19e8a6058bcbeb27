use std::path::{Path, PathBuf};

use clap::Args;
use deepfusion_data::kitti::Calibration;
use deepfusion_data::{NamedTopic, OpenOptions};
use deepfusion_eval::PostProcess;
use deepfusion_motion::ScaleMonitorConfig;

use super::values::{hfov, positive};
use super::{CameraIntrinsics, EngineArgs, LiveArgs, names};

/// Which images, through which network, to where: what `predict` and `perceive` have in common.
#[derive(Debug, Clone, Args)]
pub(crate) struct PredictionArgs {
    /// Run folder, checkpoint in it, or name of an embedded network (`weights list`) [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Images, folders of images, globs, recordings, or one live source.
    ///
    /// Recordings are a KITTI drive (raw, odometry, 360), a nuScenes folder, a bag, a video, a comma2k19 segment, an RGB-D folder or a
    /// folder with dataset.toml. They know their camera, and lens distortion is removed.
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<String>,
    /// Camera intrinsics in pixels of the input images [default: the recording's, else from EXIF's focal length, else assumed as in
    /// training].
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "fx,fy,cx,cy",
        conflicts_with = "calib"
    )]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with_all = ["intrinsics", "calib"])]
    pub hfov: Option<f64>,
    /// Calibration file: KITTI's calib_cam_to_cam.txt, YAML from OpenCV, ROS or Kalibr, or four numbers; lens distortion is removed.
    #[arg(long, value_name = "FILE")]
    pub calib: Option<PathBuf>,
    /// For bags: which topic to use for a role, if several match; may be repeated.
    ///
    /// Roles are image, camera_info, lidar, dynamic, imu, speed, steering, can and truth.
    #[arg(long = "topic", value_name = "ROLE=NAME")]
    pub topics: Vec<NamedTopic>,
    /// Do not correct depth for a focal length other than the training camera's.
    #[arg(long)]
    pub no_focal_correction: bool,
    /// Stretch images of another aspect ratio instead of cropping them around the principal row.
    ///
    /// A network trained with many cameras, like the embedded ones, sees the whole image either way, at an input size of its aspect ratio.
    #[arg(long)]
    pub stretch: bool,
    /// Test-time augmentation: average several predictions of each image.
    ///
    /// This usually lowers the error on real streets, and takes longer. Several sizes are for networks trained at several sizes, such as
    /// `street`; others may get worse. Sigma and confidence remain those of a single prediction.
    #[arg(long, value_parser = names::post_process())]
    pub post_process: Option<PostProcess>,
    /// Measured height of the camera above the road, in metres.
    ///
    /// The scale monitor, which watches recordings with speed and yaw rate, uses this height; without it, the monitor learns one from the
    /// first frames.
    #[arg(long, allow_negative_numbers = true, value_name = "M", value_parser = positive)]
    pub camera_height: Option<f64>,
    /// Slowly correct depth back to the scale of the first hundred frames when the scale monitor detects drift.
    ///
    /// The correction relies on the vehicle's speed: with a wrong speed, it makes depth wrong.
    #[arg(long)]
    pub correct_scale: bool,
    /// Output folder.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Replace existing outputs, even those made with other options or from an image that has changed since.
    #[arg(long)]
    pub overwrite: bool,
    /// Take only the first N images: of each recording, and of those that belong to none. A live source is left after N frames; skipped ones do not
    /// count.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: Option<u64>,
    /// Of a live source.
    #[command(flatten)]
    pub live: LiveArgs,
    /// What runs the network.
    #[command(flatten)]
    pub engine: EngineArgs,
}

/// Whether a calibration file is that of a KITTI date. Its recordings already have it, and it fits no others.
fn is_kitti(path: &Path) -> bool {
    let file = path.file_name();
    path.is_dir() || file.is_some_and(|name| name == Calibration::CAM_TO_CAM)
}

impl PredictionArgs {
    /// How recordings among the inputs are opened.
    pub(crate) fn open_options(&self) -> OpenOptions {
        OpenOptions {
            intrinsics: self.intrinsics.map(|k| k.numbers()),
            hfov_deg: self.hfov,
            calibration: self.calib.clone().filter(|path| !is_kitti(path)),
            topics: self.topics.clone(),
            ..OpenOptions::default()
        }
    }

    /// Settings of the scale monitor.
    pub(crate) fn scale_config(&self) -> ScaleMonitorConfig {
        ScaleMonitorConfig {
            height_m: self.camera_height,
            ..ScaleMonitorConfig::default()
        }
    }
}
