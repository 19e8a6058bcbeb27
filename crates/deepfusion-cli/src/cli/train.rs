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
    after_help = "Learns from images and the car's speed alone (turns that were not measured are taken from the images), or from recorded depth \
    (--learn depth). Writes config.toml, log.csv, TensorBoard events, the \
    checkpoints last and best, and sample panels. Options override a config file.\n\n\
    Ctrl-C, and SIGTERM as schedulers send it, save after the step at work and end with code 130. --resume continues the run as \
    configured: --epochs or --steps may make it longer, --data, --val-data, --split and --val-split say where its recordings are now, and any other \
    option that contradicts it is an error.\n\n\
    Examples:\n  deepfusion train --data kitti/2011_09_26/2011_09_26_drive_0005_sync --preset tiny\n  \
    deepfusion train --data kitti --preset light --epochs 20 --out runs/light\n  \
    deepfusion train --out runs/light --resume"
)]
pub(crate) struct TrainArgs {
    /// Recordings to train on: KITTI (raw, odometry, 360) drives or roots, nuScenes, image folders, videos [default: the config file's].
    #[arg(long, value_name = "PATH", num_args = 1.., required_unless_present_any = ["resume", "config"])]
    pub data: Vec<PathBuf>,
    /// Settings to start from [default: tiny].
    #[arg(long, value_parser = names::preset())]
    pub preset: Option<Preset>,
    /// Settings from a file: a preset and the keys in which it differs, or all of them, as written into every run as config.toml.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "preset")]
    pub config: Option<PathBuf>,
    /// Folder of the run [default: runs/train-TIME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Continue the run in --out exactly where it stopped.
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Where to compute; one of several GPUs by its index, as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Passes over the data [default: the preset's 20, and at least 1200 steps].
    #[arg(long, value_name = "N", conflicts_with = "steps")]
    pub epochs: Option<usize>,
    /// Optimiser steps, instead of epochs.
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,
    /// Size of the network's input [default: the preset's; on a processor 320x96].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Samples a step [default: the preset's; on a processor 4].
    #[arg(long, value_name = "N")]
    pub batch: Option<usize>,
    /// Fixes everything that is random.
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// What is learned from: the drive's own motion, the depth recorded with it (RGB-D, scans), or both [default: self].
    #[arg(long, value_parser = names::learn(), value_name = "LESSON")]
    pub learn: Option<Learn>,
    /// Which cameras [default: 2].
    #[arg(long, value_name = "2|3|both")]
    pub camera: Option<Cameras>,
    /// The other camera's image of the same moment is a view, too: its calibrated baseline gives metres. Takes both cameras, and the
    /// smallest error of all views (reprojection = "minimum").
    #[arg(long)]
    pub stereo: bool,
    /// Train on the frames of this split file only (lines "folder index side").
    #[arg(long, value_name = "FILE")]
    pub split: Option<PathBuf>,
    /// Recordings to validate on [default: the last tenth of each drive].
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub val_data: Vec<PathBuf>,
    /// Validate on the frames of this split file only, of --val-data, or of --data where there is none.
    #[arg(long, value_name = "FILE")]
    pub val_split: Option<PathBuf>,
    /// Last resort for recordings without intrinsics: learn one focal length for all of them, beginning at a field of view of 60
    /// degrees (another one: --set assumed_camera.hfov_deg=90), with the principal point in the middle. Needs drives with bends
    /// and a yaw rate.
    #[arg(long, value_name = "learn", value_parser = learn_camera)]
    pub intrinsics: Option<LearnCamera>,
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
    /// Weights to start from: a run, a checkpoint, a ResNet's file, the name of an embedded network (`weights list`), or none
    /// [default: the embedded network of the preset's layers, if any; with --config what the file says].
    #[arg(long, value_name = "WEIGHTS")]
    pub init: Option<PathBuf>,
    /// The pose used for warping [default: the preset's].
    #[arg(long, value_parser = names::view_motion(), value_name = "MOTION")]
    pub view_motion: Option<ViewMotion>,
    /// Parts of the network and terms of the loss to switch on.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = TrainConfig::TERMS)]
    pub with: Vec<String>,
    /// Parts of the network and terms of the loss to leave out.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = TrainConfig::TERMS)]
    pub without: Vec<String>,
    /// Any key of the configuration, as `loss.smoothness=0.01` or `data.sets[0].learn=depth` (`deepfusion config show` prints them all); may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}
