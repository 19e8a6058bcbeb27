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
    /// A run folder, a checkpoint in it, or the name of an embedded network (`weights list`) [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Images, folders of images, globs, or recordings: a drive of KITTI (raw, odometry, 360), a nuScenes folder, a bag, a video, a comma2k19
    /// segment, an RGB-D folder, a folder with dataset.toml. Recordings know their camera, and lens distortion is removed. Or one live source.
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<String>,
    /// The camera, in pixels of the input images [default: the recording's, else EXIF's focal length, else the one trained with is
    /// assumed].
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "fx,fy,cx,cy",
        conflicts_with = "calib"
    )]
    pub intrinsics: Option<CameraIntrinsics>,
    /// The camera by its field of view from left to right in degrees: square pixels, the principal point in the middle.
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with_all = ["intrinsics", "calib"])]
    pub hfov: Option<f64>,
    /// A calibration file: KITTI's calib_cam_to_cam.txt, OpenCV's, ROS's or Kalibr's YAML, or four numbers; lens distortion is removed.
    #[arg(long, value_name = "FILE")]
    pub calib: Option<PathBuf>,
    /// For bags: the topic for a role, where several topics match (roles: image, camera_info, lidar, dynamic, imu, speed, steering,
    /// can, truth). May be repeated.
    #[arg(long = "topic", value_name = "ROLE=NAME")]
    pub topics: Vec<NamedTopic>,
    /// Do not correct depth for another focal length than the one trained on.
    #[arg(long)]
    pub no_focal_correction: bool,
    /// Stretch images of another aspect ratio instead of cropping them about the principal row. A network that learned with many
    /// cameras, as the embedded ones, sees the whole image either way, at an input of its aspect ratio.
    #[arg(long)]
    pub stretch: bool,
    /// Test-time augmentation: take the mean of several predictions of each image, which usually errs less on real streets and takes longer. Several sizes are for
    /// networks that learned at several, as `street` did; others may be worse by them. Sigma and confidence stay those of one prediction.
    #[arg(long, value_parser = names::post_process())]
    pub post_process: Option<PostProcess>,
    /// The camera's height over the road in metres, where it was measured: the scale monitor, which watches recordings
    /// with speed and yaw rate, otherwise learns it from the first frames.
    #[arg(long, value_name = "M", value_parser = positive)]
    pub camera_height: Option<f64>,
    /// When the scale monitor detects drift, slowly correct depth back to the scale of the first hundred frames. It follows the
    /// vehicle's speed: a wrong speed corrects wrongly.
    #[arg(long)]
    pub correct_scale: bool,
    /// Folder to write.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Replace existing outputs, even those made with other options or from an image that has changed.
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

/// Whether a calibration is KITTI's, of a date: its recordings have it themselves, and it is of no others.
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

    /// How the scale is watched.
    pub(crate) fn scale_config(&self) -> ScaleMonitorConfig {
        ScaleMonitorConfig {
            height_m: self.camera_height,
            ..ScaleMonitorConfig::default()
        }
    }
}
