use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use deepfusion_data::{Cameras, GtKind, NamedTopic};
use deepfusion_eval::{Crop, GroundTruth, Holes, PostProcess, Protocol, Scaling};

use super::values::{ClockOffset, hfov, not_negative, positive, scaling};
use super::{CameraIntrinsics, EngineArgs, names};

/// `deepfusion eval`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("what").args(["model", "pred"])),
    after_help = "Metrics are means over images, always both unscaled and median-scaled; static and dynamic pixels are also reported separately if \
    the simulator's masks or KITTI's tracklets exist. Drives with a speed are also judged without ground truth: the scale \
    certificate is the scale bias with a 95 % interval, from frames that training did not see. Array files are .npz (matched by \
    name) or N×H×W .npy (in split order), float32 or float64, of any size: predictions are resized as disparity. The result of a run \
    is kept in RUN/eval, where `compare` finds it.\n\n\
    Examples:\n  deepfusion eval --model runs/train-1 --data kitti --split eigen/test_files.txt\n  \
    deepfusion eval --pred depth.npz --pred-kind depth --gt gt.npz --crop garg --json\n  \
    deepfusion eval --model runs/train-1 --data street --points 10000 --report street.html\n  \
    deepfusion eval --model runs/train-1 --data my-drive --speed-error 1"
)]
pub(crate) struct EvalArgs {
    /// Run folder, checkpoint in it, or name of an embedded network (`weights list`) [default: street].
    #[arg(long, value_name = "RUN|NAME", requires = "data")]
    pub model: Option<PathBuf>,
    /// Recordings to evaluate on: KITTI (raw, odometry, 360) drives or roots, nuScenes, image folders, videos, RGB-D folders.
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "pred", required_unless_present = "pred")]
    pub data: Vec<PathBuf>,
    /// Use only the frames of this split file (lines "folder index side").
    #[arg(long, value_name = "FILE", conflicts_with = "pred")]
    pub split: Option<PathBuf>,
    /// Which camera to use.
    #[arg(
        long,
        value_name = "2|3|both",
        default_value = "2",
        conflicts_with = "pred"
    )]
    pub camera: Cameras,
    /// Camera intrinsics in pixels of the images, for recordings without a calibration.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "fx,fy,cx,cy",
        conflicts_with = "pred"
    )]
    pub intrinsics: Option<CameraIntrinsics>,
    /// Horizontal field of view of the camera, in degrees (assumes square pixels and the principal point in the middle).
    #[arg(long, value_name = "DEGREES", value_parser = hfov, conflicts_with_all = ["intrinsics", "pred"])]
    pub hfov: Option<f64>,
    /// Fail unless every frame of --split exists and has ground truth.
    #[arg(long, requires = "split")]
    pub strict: bool,
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
    /// File of predicted arrays.
    #[arg(long, value_name = "FILE", requires = "pred_kind", requires = "gt")]
    pub pred: Option<PathBuf>,
    /// What the predicted arrays contain.
    #[arg(long, value_enum, requires = "pred")]
    pub pred_kind: Option<PredKind>,
    /// Ground-truth depth in metres, 0 = none; with --model, used instead of the recording's scans.
    #[arg(long, value_name = "FILE")]
    pub gt: Option<PathBuf>,
    /// Convention of the ground truth: which depth, at which pixel.
    #[arg(long, value_parser = names::gt_kind(), default_value = "z")]
    pub gt_depth: GtKind,
    /// Part of the image to compare [default: garg for KITTI raw, else none].
    #[arg(long, value_parser = names::crop())]
    pub crop: Option<Crop>,
    /// Largest ground-truth depth that counts, in metres; predictions are clamped to it.
    #[arg(long, allow_negative_numbers = true, value_name = "M", default_value_t = 80.0, value_parser = positive)]
    pub cap: f64,
    /// Smallest ground-truth depth that counts, in metres; predictions are clamped to it.
    #[arg(long, allow_negative_numbers = true, value_name = "M", default_value_t = 1e-3, value_parser = positive)]
    pub min: f64,
    /// Add a row with a fixed factor (fixed=F); none and median are always reported.
    #[arg(long, value_name = "none|median|fixed=F", default_value = "none", value_parser = scaling)]
    pub scale: Scaling,
    /// Also sample N of the compared pixels at random, and report how far their points are from the LiDAR's in space.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub points: usize,
    /// Random seed; decides which points are sampled.
    #[arg(long, value_name = "S", default_value_t = 0, requires = "points")]
    pub points_seed: u64,
    /// Also write the sampled points as CSV: image, pixel, true and predicted position in the camera's axes, error.
    #[arg(long, value_name = "FILE.csv", requires = "points")]
    pub points_out: Option<PathBuf>,
    /// Test-time augmentation: average several predictions of each image, as `predict --post-process` does.
    ///
    /// The verdict is then left out, because it is about the network's own predictions.
    #[arg(long, value_parser = names::post_process(), conflicts_with_all = ["pred", "calibrate_confidence", "calibrate_uncertainty"])]
    pub post_process: Option<PostProcess>,
    /// Also write a page that opens offline: tables, charts, best and worst frames, learning curves, settings.
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Replace existing files of --report and --points-out.
    #[arg(long)]
    pub overwrite: bool,
    /// Allow holes: leave out and count predicted values that are NaN, infinite or not above 0.
    #[arg(long)]
    pub allow_holes: bool,
    /// Training scans (from data export-gt) for the mean-depth baseline [default: those the model was trained on, if known].
    #[arg(long, value_name = "FILE.npz")]
    pub trivial: Option<PathBuf>,
    /// Do not correct depth for a focal length other than the training camera's.
    #[arg(long, conflicts_with = "pred")]
    pub no_focal_correction: bool,
    /// Fit a confidence for each pixel, and keep it beside the run.
    ///
    /// `perceive` then adds a confidence to its clouds, and --report shows whether it holds on frames that the fit has not seen: other
    /// drives, or another part of a single drive.
    #[arg(long, requires = "model", conflicts_with = "gt")]
    pub calibrate_confidence: bool,
    /// Calibrate the intervals that a network with `depth_net.uncertainty` predicts, and keep the factors beside the run.
    ///
    /// Use drives that training has not seen, and measure the result on others.
    #[arg(long, requires = "model", conflicts_with = "gt")]
    pub calibrate_uncertainty: bool,
    /// Compare with ground truth only; skip the verdict from speeds and images.
    #[arg(long, conflicts_with = "pred")]
    pub no_verdict: bool,
    /// Uncertainty of the vehicle's speed in per cent (one standard error), which the scale certificate's interval allows for.
    #[arg(long, allow_negative_numbers = true, value_name = "PERCENT", default_value_t = 3.0, value_parser = not_negative, conflicts_with_all = ["pred", "no_verdict"])]
    pub speed_error: f64,
    /// Assume that training saw none of these frames, if the program cannot know: for networks that were trained elsewhere.
    #[arg(long, conflicts_with_all = ["pred", "no_verdict"])]
    pub assume_unseen: bool,
    /// What runs the network.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

impl EvalArgs {
    /// The protocol that the options give, with `default_crop` unless `--crop` is given.
    pub(crate) fn protocol(&self, default_crop: Crop) -> Protocol {
        Protocol {
            crop: self.crop.unwrap_or(default_crop),
            cap_m: self.cap,
            min_m: self.min,
            gt: match self.gt_depth {
                GtKind::Z => GroundTruth::Z,
                GtKind::Velodyne => GroundTruth::Velodyne,
                GtKind::Annotated => GroundTruth::Annotated,
            },
            scaling: self.scale,
            holes: if self.allow_holes {
                Holes::Skip
            } else {
                Holes::Refuse
            },
            points: self.points,
            points_seed: self.points_seed,
            ..Protocol::default()
        }
    }
}

/// What a predicted array holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PredKind {
    /// Camera z in metres.
    Depth,
    /// 1 / depth.
    Disparity,
}
