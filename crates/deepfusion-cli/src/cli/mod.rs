//! The command line's shape: what can be said, not what it does.

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
    /// What to do; without it, an overview with examples.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// No progress on stderr, only warnings and errors.
    #[arg(long, short, global = true, display_order = 900)]
    pub quiet: bool,
}

/// Everything the program can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// With no data at all: depth, cloud and targets of a new street, then learning there.
    #[cfg(feature = "train")]
    Demo(DemoArgs),
    /// Write a simulated drive with exact ground truth.
    Simulate(SimulateArgs),
    /// Look into recordings.
    #[command(subcommand)]
    Data(DataCommand),
    /// A camera's intrinsics and lens from pictures or a video of a checkerboard, as a calibration file.
    Calibrate(CalibrateArgs),
    /// Every reason why training on a recording would fail or give a wrong scale; alone, what this machine has.
    Doctor(DoctorArgs),
    /// Train on drives, without depth labels.
    #[cfg(feature = "train")]
    Train(Box<TrainArgs>),
    /// Fine-tune an existing network on new drives; the result is kept only if no check gets clearly worse.
    #[cfg(feature = "train")]
    Adapt(Box<AdaptArgs>),
    /// What can be configured.
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Train and measure with parts of the system switched off: the on/off table of the paper.
    #[cfg(feature = "train")]
    Ablate(Box<AblateArgs>),
    /// Measure depth: the field's seven metrics, unscaled and median-scaled.
    Eval(Box<EvalArgs>),
    /// Evaluations side by side, and beside the field's published tables.
    Compare(Box<CompareArgs>),
    /// Measure the camera's path: drift, five-frame error, scale.
    #[cfg(feature = "train")]
    EvalOdometry(EvalOdometryArgs),
    /// Measure 3D targets against labelled boxes: recall, precision, errors, identities.
    EvalTargets(Box<EvalTargetsArgs>),
    /// Metric depth of images.
    Predict(Box<PredictArgs>),
    /// 3D targets: boxes, distance, size, track, velocity.
    Perceive(Box<PerceiveArgs>),
    /// Look at results in the browser: picture, depth in metres, cloud, boxes and tracks, over time.
    View(ViewArgs),
    /// A trained network as an ONNX file, checked before it is kept.
    #[cfg(feature = "train")]
    Export(ExportArgs),
    /// Embedded networks, and weights of other programs.
    #[command(subcommand)]
    Weights(WeightsCommand),
    /// Measure speed: milliseconds per stage, frames a second, memory.
    Bench(BenchArgs),
    /// What a shell needs to complete the command line, or pages of the manual.
    Completions(CompletionsArgs),
}

/// `deepfusion demo`.
#[derive(Debug, Args)]
#[command(
    after_help = "Takes a few minutes on two cores. Leaves pictures, a point cloud and report.html.\n\n\
    Examples:\n  deepfusion demo --out runs/first\n  deepfusion demo --from-scratch --out runs/second"
)]
pub(crate) struct DemoArgs {
    /// Folder for everything it makes [default: runs/demo-TIME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the final evaluation as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Start from nothing: train a small network on six simulated streets for some minutes, and measure it on a seventh.
    #[arg(long)]
    pub from_scratch: bool,
    /// Chooses the streets.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Where to compute; one of several GPUs by its index, as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Frames of each drive; fewer than 12 may leave no scan to measure on. This and the next two make the way short enough to be tested.
    #[arg(long, hide = true, value_name = "N", value_parser = clap::value_parser!(u16).range(12..))]
    pub frames: Option<u16>,
    /// Steps of training.
    #[arg(long, hide = true, value_name = "N")]
    pub steps: Option<usize>,
    /// Size of the pictures, and of what the network learns from.
    #[arg(long, hide = true, value_name = "WxH")]
    pub size: Option<Size>,
}

/// `deepfusion simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Equal settings give equal drives, byte for byte.\n\n\
    Examples:\n  deepfusion simulate --out street --frames 200 --seed 7\n  \
    deepfusion simulate --out traffic --frames 100 --moving-cars 6 --size 1242x375\n  \
    deepfusion simulate --out other --varied --seed 8 --scene country\n  \
    deepfusion simulate --out garage --format bag --scene garage --frames 250")]
pub(crate) struct SimulateArgs {
    /// Folder to write, new or empty.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Layout of the drive.
    #[arg(long, value_enum, default_value_t)]
    pub format: SimulateFormat,
    /// Number of frames.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub frames: usize,
    /// Chooses the street, its look, the light and the way it is driven.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Kind of place.
    #[arg(long, value_parser = names::scene(), default_value = "urban")]
    pub scene: Scene,
    /// Number of moving cars; with --varied, cars whose way is blocked are left out.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub moving_cars: usize,
    /// Number of people who ride bicycles, walk along pavements and cross the road.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub riders: usize,
    /// Draw the camera (lens, height, pitch, roll, softness, noise, exposure, JPEG), the light, the weather and what the street looks like from the seed,
    /// once for the drive, as training draws its simulated views. varied.json in the drive's folder (of a bag: NAME.varied.json beside it) says what was
    /// drawn. Roads stay flat, and a LiDAR sees as in clear air.
    #[arg(long)]
    pub varied: bool,
    /// Size of the pictures [default: 640x192; UMAD's 640x480 in a bag].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Frames a second [default: 10; UMAD's 25 in a bag].
    #[arg(long, allow_negative_numbers = true, value_name = "HZ")]
    pub fps: Option<f64>,
    /// Sensors of the car [default: those of the layout's data set].
    #[arg(long, value_parser = names::sensors())]
    pub sensors: Option<Sensors>,
    /// Height of the camera above the road [default: 1.65].
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub camera_height: Option<f64>,
    /// Write the pictures of a second camera, too, so far to the right of the first one (KITTI's: 0.53).
    #[arg(long, value_name = "M", value_parser = values::positive)]
    pub stereo: Option<f64>,
    /// Set the clock of camera and LiDAR so many milliseconds ahead of the vehicle's (bag).
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
    /// A velodyne scan for every N-th frame (KITTI); 0 writes none [default: 1].
    #[arg(long, value_name = "N")]
    pub scan_every: Option<usize>,
    /// Print what was written as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Layouts the simulator writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum SimulateFormat {
    /// KITTI raw: images, oxts, velodyne scans, calibration, and exact depth beside them.
    #[default]
    Kitti,
    /// A ROS 1 bag as UMAD's: camera, FMCW LiDAR, inertial unit, CAN speed and steering, and the truth.
    Bag,
}
