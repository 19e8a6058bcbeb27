use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use deepfusion_eval::PostProcess;

use super::{EngineArgs, names};

/// `deepfusion eval-targets`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("source").args(["model", "depth"]).required(true)),
    after_help = "Boxes come from a drive's tracklet_labels.xml (KITTI raw's or the simulator's) or from KITTI's object labels. A box counts if \
    enough of it is visible; trees, poles, buildings and fences count as neither right nor wrong.\n\n\
    Examples:\n  deepfusion eval-targets --data street --depth truth\n  \
    deepfusion eval-targets --data kitti/2011_09_26/2011_09_26_drive_0005_sync --model runs/train-1"
)]
pub(crate) struct EvalTargetsArgs {
    /// Drives with labelled boxes.
    #[arg(long, required = true, num_args = 1.., value_name = "PATH")]
    pub data: Vec<PathBuf>,
    /// Run (its folder or a checkpoint in it) or name of an embedded network whose predicted depth to use.
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Measured depth to use instead.
    #[arg(long, value_enum)]
    pub depth: Option<TargetDepth>,
    /// Test-time augmentation: average several predictions of each image, as `predict --post-process` does.
    #[arg(long, value_parser = names::post_process(), conflicts_with = "depth")]
    pub post_process: Option<PostProcess>,
    /// Perception settings (TOML).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Folder for a picture of each frame with its targets' boxes, to see what was found.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What runs the network.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Where measured depth comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetDepth {
    /// The simulator's exact depth of every pixel.
    Truth,
    /// The drive's scans, as an image coarse enough for them to fill.
    Lidar,
}
