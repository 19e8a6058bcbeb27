//! The command line's arguments; `commands` does the work.

mod ablate;
mod adapt;
mod calibrate;
mod compare;
mod completions;
mod config;
mod data;
mod device;
mod doctor;
mod engine;
mod eval;
mod eval_odometry;
mod eval_targets;
mod export;
mod instances;
mod live;
mod names;
mod perceive;
mod predict;
mod prediction;
mod train;
mod values;
mod view;
mod weights;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use deepfusion_rosbag::Compression;
use deepfusion_sim::{Scene, Sensors};

use crate::devices::ComputeDevice;
use device::device;

pub(crate) use ablate::AblateArgs;
pub(crate) use adapt::{AdaptArgs, SimulatedView};
pub(crate) use calibrate::CalibrateArgs;
pub(crate) use compare::{CompareArgs, TableFormat};
pub(crate) use completions::{CompletionsArgs, CompletionsKind};
pub(crate) use config::{ConfigCommand, ConfigSource, ShowArgs};
pub(crate) use data::{ConvertArgs, DataCommand, ExportGtArgs, ImportArgs, InspectArgs};
pub(crate) use doctor::DoctorArgs;
pub(crate) use engine::EngineArgs;
pub(crate) use eval::{EvalArgs, PredKind};
pub(crate) use eval_odometry::EvalOdometryArgs;
pub(crate) use eval_targets::{EvalTargetsArgs, TargetDepth};
pub(crate) use export::ExportArgs;
pub(crate) use instances::InstanceArgs;
pub(crate) use live::LiveArgs;
pub(crate) use perceive::PerceiveArgs;
pub(crate) use predict::{BenchArgs, PredictArgs};
pub(crate) use prediction::PredictionArgs;
pub(crate) use train::TrainArgs;
pub(crate) use values::{CameraIntrinsics, ClockOffset, Shard, Size};
pub(crate) use view::ViewArgs;
pub(crate) use weights::{AverageArgs, CalibrateWeightsArgs, PackArgs, WeightsCommand};

/// Metric depth from one camera and a speed signal.
#[derive(Debug, Parser)]
#[command(
    name = "deepfusion",
    version,
    max_term_width = 100,
    subcommand_required = false
)]
pub(crate) struct Cli {
    /// What to do. Without a command: an overview with examples.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Print no progress on stderr, only warnings and errors.
    #[arg(long, short, global = true, display_order = 900)]
    pub quiet: bool,
}

/// Everything the program can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the whole workflow without any data: depth, point cloud and targets of a simulated street, then training there.
    #[cfg(feature = "train")]
    Demo(DemoArgs),
    /// Simulate a drive with exact ground truth.
    Simulate(SimulateArgs),
    /// Inspect, convert and import recordings, and export their ground truth.
    #[command(subcommand)]
    Data(DataCommand),
    /// Measure a camera's intrinsics and lens distortion from pictures or a video of a checkerboard; writes a calibration file.
    Calibrate(CalibrateArgs),
    /// List every reason why training on a recording would fail or give a wrong scale; without a recording, show what this machine has.
    Doctor(DoctorArgs),
    /// Train a network on drives, without depth labels.
    #[cfg(feature = "train")]
    Train(Box<TrainArgs>),
    /// Fine-tune an existing network on new drives; the result is kept only if no check gets clearly worse.
    #[cfg(feature = "train")]
    Adapt(Box<AdaptArgs>),
    /// Show the configuration, with the meaning of every key.
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Train and evaluate with parts of the system switched off: the paper's ablation table.
    #[cfg(feature = "train")]
    Ablate(Box<AblateArgs>),
    /// Evaluate depth: the field's seven metrics, unscaled and median-scaled.
    Eval(Box<EvalArgs>),
    /// Compare evaluations side by side, and with the field's published tables.
    Compare(Box<CompareArgs>),
    /// Evaluate the camera's trajectory: drift, five-frame error, scale.
    #[cfg(feature = "train")]
    EvalOdometry(EvalOdometryArgs),
    /// Evaluate 3D targets against labelled boxes: recall, precision, errors, identities.
    EvalTargets(Box<EvalTargetsArgs>),
    /// Predict metric depth for images, recordings or a live camera.
    Predict(Box<PredictArgs>),
    /// Find 3D targets: boxes with distance, size, track and velocity.
    Perceive(Box<PerceiveArgs>),
    /// View results in the browser: image, depth in metres, point cloud, boxes and tracks over time.
    View(ViewArgs),
    /// Export a trained network as an ONNX file, checked before it is kept.
    #[cfg(feature = "train")]
    Export(ExportArgs),
    /// List embedded networks; import, average, pack and calibrate weights.
    #[command(subcommand)]
    Weights(WeightsCommand),
    /// Measure speed: milliseconds per stage, frames per second, memory.
    Bench(BenchArgs),
    /// Print shell completions, or write man pages.
    Completions(CompletionsArgs),
}

/// `deepfusion demo`.
#[derive(Debug, Args)]
#[command(
    after_help = "It takes a few minutes on two cores, and leaves pictures, a point cloud and report.html.\n\n\
    Examples:\n  deepfusion demo --out runs/first\n  deepfusion demo --from-scratch --out runs/second"
)]
pub(crate) struct DemoArgs {
    /// Output folder [default: runs/demo-TIME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the final evaluation as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Start from random weights.
    ///
    /// A small network trains on six simulated streets for some minutes, and is evaluated on a seventh.
    #[arg(long)]
    pub from_scratch: bool,
    /// Random seed; decides which streets are simulated.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Frames of each drive; fewer than 12 may leave no scan to measure on. This and the next two options make the demo short enough for
    /// tests.
    #[arg(long, hide = true, value_name = "N", value_parser = clap::value_parser!(u16).range(12..))]
    pub frames: Option<u16>,
    /// Training steps.
    #[arg(long, hide = true, value_name = "N")]
    pub steps: Option<usize>,
    /// Size of the images and of the network's input.
    #[arg(long, hide = true, value_name = "WxH")]
    pub size: Option<Size>,
}

/// `deepfusion simulate`.
#[derive(Debug, Args)]
#[command(
    after_help = "The same settings give the same drive, byte for byte.\n\n\
    Examples:\n  deepfusion simulate --out street --frames 200 --seed 7\n  \
    deepfusion simulate --out traffic --frames 100 --moving-cars 6 --size 1242x375\n  \
    deepfusion simulate --out other --varied --seed 8 --scene country\n  \
    deepfusion simulate --out garage --format bag --scene garage --frames 250"
)]
pub(crate) struct SimulateArgs {
    /// Output folder, new or empty.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Layout of the drive.
    #[arg(long, value_enum, default_value_t)]
    pub format: SimulateFormat,
    /// Number of frames.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub frames: usize,
    /// Random seed; decides the street, its look, the light and how it is driven.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Kind of scene.
    #[arg(long, value_parser = names::scene(), default_value = "urban")]
    pub scene: Scene,
    /// Number of moving cars; with --varied, cars whose way is blocked are left out.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub moving_cars: usize,
    /// Number of people who ride bicycles, walk along pavements or cross the road.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub riders: usize,
    /// Randomise camera, light, weather and street, as training does for its simulated views.
    ///
    /// The camera (lens, height, pitch, roll, softness, noise, exposure, JPEG), the light, the weather and the look of the street are drawn
    /// from the seed, once per drive. varied.json in the drive's folder (for a bag: NAME.varied.json beside it) records what was drawn.
    /// Roads stay flat, and the LiDAR sees as in clear air.
    #[arg(long)]
    pub varied: bool,
    /// Size of the images [default: 640x192; in a bag UMAD's 640x480].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Frames per second [default: 10; in a bag UMAD's 25].
    #[arg(long, allow_negative_numbers = true, value_name = "HZ")]
    pub fps: Option<f64>,
    /// The vehicle's sensors [default: those of the layout's data set].
    #[arg(long, value_parser = names::sensors())]
    pub sensors: Option<Sensors>,
    /// Height of the camera above the road, in metres [default: 1.65].
    #[arg(long, allow_negative_numbers = true, value_name = "M", value_parser = values::positive)]
    pub camera_height: Option<f64>,
    /// Also write the images of a second camera, this far to the right of the first one, in metres (KITTI's: 0.53).
    #[arg(long, allow_negative_numbers = true, value_name = "M", value_parser = values::positive)]
    pub stereo: Option<f64>,
    /// Set the clock of camera and LiDAR this many milliseconds ahead of the vehicle's (bags only).
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub clock_offset: f64,
    /// Compression of the bag [default: lz4].
    #[arg(long, value_parser = names::compression())]
    pub compression: Option<Compression>,
    /// Write a velodyne scan for every N-th frame (KITTI only); 0 writes none [default: 1].
    #[arg(long, value_name = "N")]
    pub scan_every: Option<usize>,
    /// Print what was written as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Layouts the simulator writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum SimulateFormat {
    /// KITTI raw: images, OXTS, velodyne scans and calibration, with exact depth beside them.
    #[default]
    Kitti,
    /// A ROS 1 bag like UMAD's: camera, FMCW LiDAR, IMU, CAN speed and steering, and the ground truth.
    Bag,
}
