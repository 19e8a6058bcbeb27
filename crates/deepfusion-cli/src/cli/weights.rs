use std::path::PathBuf;

use clap::{Args, Subcommand};
use deepfusion_model::CheckpointKind;

use super::names;
use super::values::share;

/// `deepfusion weights …`.
#[derive(Debug, Subcommand)]
pub(crate) enum WeightsCommand {
    /// Make a run of weights of torchvision's ResNet, of Monodepth2, Lite-Mono, R-MSFM or SfMLearner (.pth, .safetensors).
    #[command(
        after_help = "Examples:\n  deepfusion weights import encoder.pth depth.pth pose_encoder.pth pose.pth --out runs/monodepth2\n  \
        deepfusion weights import resnet18-5c106cde.pth --out runs/imagenet18"
    )]
    #[cfg(feature = "train")]
    Import {
        /// The files: one of a ResNet or of SfMLearner's DispNet, or another network's encoder, depth, pose_encoder and pose.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Folder of the run to make.
        #[arg(long, value_name = "RUN")]
        out: PathBuf,
    },
    /// Pack a run as an embedded network: its weights in bf16, and a card.
    Pack(PackArgs),
    /// Average the weights of runs that began from the same network: one network out of several.
    Average(AverageArgs),
    /// Find the ranges of what a network's convolutions read on your images, for `--precision int8`.
    Calibrate(CalibrateWeightsArgs),
    /// Which networks are embedded and what they were made from; which weights can be imported.
    List {
        /// Print as JSON.
        #[arg(long)]
        json: bool,
    },
}

/// `deepfusion weights calibrate`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes RUN/int8.toml, or the card of a packed network (FILE.safetensors). `predict`, `perceive`, `eval`, `bench` and `view` then take \
    --precision int8. Look at images like those that the network will see; 32 are enough. After more training, calibrate again.\n\n\
    Example:\n  deepfusion weights calibrate --model runs/first my-drive\n  deepfusion eval --model runs/first --data my-drive --precision int8"
)]
pub(crate) struct CalibrateWeightsArgs {
    /// A run's folder, a checkpoint in it, or a packed network.
    #[arg(long, value_name = "RUN")]
    pub model: PathBuf,
    /// Images, folders, patterns and recordings.
    #[arg(required = true, value_name = "IMAGE|DRIVE")]
    pub inputs: Vec<String>,
    /// Look at this many of the images, evenly spread.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u16).range(1..))]
    pub images: u16,
    /// Depth may differ from f32's by this share on average; convolutions that harm it most stay in bf16.
    #[arg(long, value_name = "SHARE", default_value_t = 0.005, value_parser = share)]
    pub most_deviation: f64,
    /// The data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
    /// Print the ranges as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion weights average`.
#[derive(Debug, Args)]
#[command(
    after_help = "The mean of networks that were trained from the same one can be better than each on images that none of them saw (model soups): measure it. It costs \
    no training. Settings and PoseNet are the first run's; intervals and int8 are calibrated anew. Where one of them does not say how sure it is, the mean does not.\n\n\
    Examples:\n  deepfusion weights average runs/video runs/mixed --out runs/mean\n  \
    deepfusion weights average runs/own street --shares 2,1 --out runs/careful      # less of what one drive taught"
)]
pub(crate) struct AverageArgs {
    /// A run's folder (its best checkpoint, where there is one) or a checkpoint in it; after the first also packed networks, and embedded ones by their names.
    #[arg(required = true, num_args = 2.., value_name = "RUN|NAME")]
    pub models: Vec<PathBuf>,
    /// One positive number for each, in the order given: how much it counts [default: all alike].
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    pub shares: Option<Vec<f64>>,
    /// New folder for the run to make.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print what was averaged as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion weights pack`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes DIR/NAME.safetensors, the depth network alone (kernels rounded to bf16, vectors in f32), and DIR/NAME.toml: the run's \
    configuration, the names of its recordings, the evaluations that the run keeps of this checkpoint, licence and SHA-256. The same run \
    gives the same bytes. `--model` and `--init` take the .safetensors file; in crates/deepfusion-weights/weights both are built into the \
    program.\n\n\
    Example:\n  deepfusion weights pack --model runs/street --name street --simulated-only --out packed"
)]
pub(crate) struct PackArgs {
    /// A run folder or a checkpoint in it.
    #[arg(long, value_name = "RUN")]
    pub model: PathBuf,
    /// Which checkpoint [default: best, where there is one].
    #[arg(long, value_parser = names::checkpoint())]
    pub checkpoint: Option<CheckpointKind>,
    /// What `--model` is to call it: letters a to z, digits and dashes.
    #[arg(long, value_name = "NAME")]
    pub name: String,
    /// Folder for the two files.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A note for its card.
    #[arg(long, value_name = "TEXT")]
    pub note: Option<String>,
    /// The recipe for its card: a file of recipes/, or a command.
    #[arg(long, value_name = "TEXT")]
    pub recipe: Option<String>,
    /// The licence for its card.
    #[arg(long, value_name = "TERMS", default_value = env!("CARGO_PKG_LICENSE"))]
    pub licence: String,
    /// Say in its card that it learned from no real image: real recordings then count as not seen in training. Refused where it, a run
    /// that it began from, or one that it is the mean of learned from KITTI (raw, odometry, 360) or nuScenes; a warning names other
    /// recordings of which nothing shows that they were simulated, as bags.
    #[arg(long)]
    pub simulated_only: bool,
    /// Replace files that are there.
    #[arg(long)]
    pub overwrite: bool,
    /// Print the card as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
