use std::path::PathBuf;

use clap::Args;
use deepfusion_data::Cameras;
use deepfusion_model::{Preset, ViewMotion};

use super::device::device;
use super::{Size, names};
use crate::devices::ComputeDevice;

/// The parts and terms that no row decides.
const SHARED_TERMS: [&str; 6] = [
    "attention",
    "aggregation",
    "smoothness",
    "automask",
    "affine",
    "moving",
];

/// `deepfusion ablate`.
#[derive(Debug, Args)]
#[command(
    after_help = "Trains and evaluates the paper's Table 3: context encoding (hce), speed loss and flow loss, each on or off, in all eight \
    combinations. Rows differ in these alone: steps, attention and everything else are equal. Every row warps with PoseNet's motion, \
    because a measured one would also teach the rows without the speed loss. A further row, minimum, is trained if --rows names it: \
    everything on, with three frames and minimum reprojection instead of two frames in both directions.\n\n\
    Every seed of a row is a run of its own, kept in DIR/rows; --resume continues where it stopped, even inside a row. The table is \
    written after every run: table.txt, .csv, .md, .tex.\n\n\
    Examples:\n  deepfusion ablate --data street --eval-data other-street --budget 1200 --seeds 3 --out runs/ablation\n  \
    deepfusion ablate --data street --budget 1200 --with attention,moving --rows hce+speed+flow,speed+flow,minimum\n  \
    deepfusion ablate --out runs/ablation --resume"
)]
pub(crate) struct AblateArgs {
    /// Recordings to train on: drive folders, date folders or KITTI roots.
    #[arg(long, value_name = "PATH", num_args = 1.., required_unless_present = "resume")]
    pub data: Vec<PathBuf>,
    /// Recordings to evaluate on [default: those trained on, which the table then says].
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "resume")]
    pub eval_data: Vec<PathBuf>,
    /// Optimiser steps of each run.
    #[arg(
        long,
        value_name = "N",
        required_unless_present = "resume",
        conflicts_with = "resume"
    )]
    pub budget: Option<usize>,
    /// Runs per row, with the seeds 0 to K − 1; a larger K adds runs to a resumed table [default: 1].
    #[arg(long, value_name = "K")]
    pub seeds: Option<usize>,
    /// Preset for everything that the rows do not change [default: light].
    #[arg(long, value_parser = names::preset(), conflicts_with = "resume")]
    pub preset: Option<Preset>,
    /// Settings from a file, like the config.toml of every run.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["preset", "resume"])]
    pub config: Option<PathBuf>,
    /// Only these rows: what is on, joined by +; none; or minimum [default: the eight of Table 3].
    #[arg(
        long,
        value_name = "ROW,…",
        value_delimiter = ',',
        conflicts_with = "resume"
    )]
    pub rows: Vec<String>,
    /// Input size of the network.
    #[arg(long, value_name = "WxH", conflicts_with = "resume")]
    pub size: Option<Size>,
    /// Samples per step.
    #[arg(long, value_name = "N", conflicts_with = "resume")]
    pub batch: Option<usize>,
    /// Parts that all rows have; moving only works where the flow is on.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = SHARED_TERMS, conflicts_with = "resume")]
    pub with: Vec<String>,
    /// Parts that no row has.
    #[arg(long, value_name = "TERM,…", value_delimiter = ',', value_parser = SHARED_TERMS, conflicts_with = "resume")]
    pub without: Vec<String>,
    /// Pose used for warping [default: posenet; with --config the file's].
    #[arg(long, value_parser = names::view_motion(), value_name = "MOTION", conflicts_with = "resume")]
    pub view_motion: Option<ViewMotion>,
    /// Set a key of the configuration, such as `loss.smoothness=0.01` (`deepfusion config show` prints them all); may be repeated.
    #[arg(long, value_name = "KEY=VALUE", conflicts_with = "resume")]
    pub set: Vec<String>,
    /// Which cameras to use.
    #[arg(
        long,
        value_name = "2|3|both",
        default_value = "2",
        conflicts_with = "resume"
    )]
    pub camera: Cameras,
    /// Folder for the table and its runs [default: runs/ablate-TIME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Continue the table in --out.
    #[arg(long, requires = "out")]
    pub resume: bool,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Print the table as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
