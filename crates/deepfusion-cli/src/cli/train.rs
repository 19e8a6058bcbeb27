use std::path::PathBuf;

use clap::Args;
use deepfusion_data::{Cameras, NamedTopic};
use deepfusion_model::{Learn, Preset, TrainConfig, ViewMotion};

use super::device::device;
use super::values::{ClockOffset, LearnCamera, learn_camera};
use super::{Size, names};
use crate::devices::ComputeDevice;

/// `deepfusion train`.
#[derive(Debug, Args)]
#[command(
    after_help = "Training needs only the images and the vehicle's speed (turns that were not measured are estimated from the images), or recorded \
    depth (--learn depth). It writes config.toml, log.csv, TensorBoard events, the checkpoints last and best, and sample panels. \
    Options override the config file.\n\n\
    Ctrl-C and SIGTERM (as sent by schedulers) finish the current step, save, and end with code 130. --resume continues the run as \
    it was configured: --epochs or --steps may make it longer; --data, --val-data, --split and --val-split say where its recordings \
    are now; any other option that contradicts the run is an error.\n\n\
    Examples:\n  deepfusion train --data kitti/2011_09_26/2011_09_26_drive_0005_sync --preset tiny\n  \
    deepfusion train --data kitti --preset light --epochs 20 --out runs/light\n  \
    deepfusion train --out runs/light --resume"
)]
pub(crate) struct TrainArgs {
    /// Recordings to train on [default: those of the config file].
    ///
    /// KITTI (raw, odometry, 360) drives or roots, nuScenes, image folders, videos.
    #[arg(long, value_name = "PATH", num_args = 1.., required_unless_present_any = ["resume", "config"])]
    pub data: Vec<PathBuf>,
    /// Preset to start from [default: tiny].
    #[arg(long, value_parser = names::preset())]
    pub preset: Option<Preset>,
    /// Settings from a file.
    ///
    /// The file contains a preset and the keys in which it differs, or all keys, like the config.toml of every run.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "preset")]
    pub config: Option<PathBuf>,
    /// Run folder [default: runs/train-TIME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Continue the run in --out exactly where it stopped.
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Passes over the data [default: the preset's 20, and at least 1200 steps].
    #[arg(long, value_name = "N", conflicts_with = "steps")]
    pub epochs: Option<usize>,
    /// Optimiser steps, instead of epochs.
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,
    /// Input size of the network [default: the preset's; on a processor 320x96].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Samples per step [default: the preset's; on a processor 4].
    #[arg(long, value_name = "N")]
    pub batch: Option<usize>,
    /// Random seed.
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// What to learn from: the drive's own motion, the depth recorded with it (RGB-D, scans), or both [default: self].
    #[arg(long, value_parser = names::learn(), value_name = "LESSON")]
    pub learn: Option<Learn>,
    /// Which cameras to use [default: 2].
    #[arg(long, value_name = "2|3|both")]
    pub camera: Option<Cameras>,
    /// Also use the other camera's image of the same moment as a source: the calibrated baseline gives metres.
    ///
    /// Both cameras are used, and each pixel takes the smallest error of all sources (reprojection = "minimum").
    #[arg(long)]
    pub stereo: bool,
    /// Train only on the frames of this split file (lines "folder index side").
    #[arg(long, value_name = "FILE")]
    pub split: Option<PathBuf>,
    /// Recordings to validate on [default: the last tenth of each drive].
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub val_data: Vec<PathBuf>,
    /// Validate only on the frames of this split file, which selects from --val-data or, without it, from --data.
    #[arg(long, value_name = "FILE")]
    pub val_split: Option<PathBuf>,
    /// Last resort for recordings without intrinsics: learn one focal length for all of them.
    ///
    /// It starts at a field of view of 60 degrees (--set assumed_camera.hfov_deg=90 starts elsewhere), with the principal point in the
    /// middle. Needs drives with bends and a yaw rate.
    #[arg(long, value_name = "learn", value_parser = learn_camera)]
    pub intrinsics: Option<LearnCamera>,
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
    /// Weights to start from [default: the embedded network with the preset's layers, if any; with --config what the file says].
    ///
    /// A run, a checkpoint, a ResNet file, the name of an embedded network (`weights list`), or none.
    #[arg(long, value_name = "WEIGHTS")]
    pub init: Option<PathBuf>,
    /// Pose used for warping [default: the preset's].
    #[arg(long, value_parser = names::view_motion(), value_name = "MOTION")]
    pub view_motion: Option<ViewMotion>,
    /// Parts of the network and loss terms to switch on.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = TrainConfig::TERMS)]
    pub with: Vec<String>,
    /// Parts of the network and loss terms to leave out.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = TrainConfig::TERMS)]
    pub without: Vec<String>,
    /// Set a key of the configuration; may be repeated.
    ///
    /// For example `loss.smoothness=0.01` or `data.sets[0].learn=depth`; `deepfusion config show` prints all keys.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}
