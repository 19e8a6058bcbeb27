use std::path::PathBuf;

use clap::{Args, Subcommand};
use deepfusion_model::CheckpointKind;

use super::names;
use super::values::share;

/// `deepfusion weights …`.
#[derive(Debug, Subcommand)]
pub(crate) enum WeightsCommand {
    /// Make a run from the weights of torchvision's ResNet, Monodepth2, Lite-Mono, R-MSFM or SfMLearner (.pth, .safetensors).
    #[command(
        after_help = "Examples:\n  deepfusion weights import encoder.pth depth.pth pose_encoder.pth pose.pth --out runs/monodepth2\n  \
        deepfusion weights import resnet18-5c106cde.pth --out runs/imagenet18"
    )]
    #[cfg(feature = "train")]
    Import {
        /// The files: one for a ResNet or SfMLearner's DispNet, else the network's encoder, depth, pose_encoder and pose.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Run folder to write.
        #[arg(long, value_name = "RUN")]
        out: PathBuf,
    },
    /// Pack a run like an embedded network: its weights in bf16, and a card.
    Pack(PackArgs),
    /// Average the weights of runs that started from the same network.
    Average(AverageArgs),
    /// Calibrate a network for `--precision int8`: measure the input ranges of its convolutions on your images.
    Calibrate(CalibrateWeightsArgs),
    /// List the embedded networks and what they were made from, and the weights that can be imported.
    List {
        /// Print as JSON.
        #[arg(long)]
        json: bool,
    },
}

/// `deepfusion weights calibrate`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes RUN/int8.toml, or into the card of a packed network (FILE.safetensors). `predict`, `perceive`, `eval`, `bench` and `view` \
    then take --precision int8. Use images like those that the network will see; 32 are enough. Calibrate again after further \
    training.\n\n\
    Example:\n  deepfusion weights calibrate --model runs/first my-drive\n  deepfusion eval --model runs/first --data my-drive --precision int8"
)]
pub(crate) struct CalibrateWeightsArgs {
    /// Run folder, checkpoint in it, or packed network.
    #[arg(long, value_name = "RUN")]
    pub model: PathBuf,
    /// Images, folders, globs and recordings.
    #[arg(required = true, value_name = "IMAGE|DRIVE")]
    pub inputs: Vec<String>,
    /// Number of images to use, evenly spread.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u16).range(1..))]
    pub images: u16,
    /// How far depth may deviate from f32's on average, as a share; convolutions that harm it most stay in bf16.
    #[arg(long, value_name = "SHARE", default_value_t = 0.005, value_parser = share)]
    pub most_deviation: f64,
    /// Data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
    /// Print the ranges as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion weights average`.
#[derive(Debug, Args)]
#[command(
    after_help = "The mean of networks that were trained from the same one can be better than each of them on images that none has seen (model \
    soups): evaluate it. It needs no training. Settings and PoseNet come from the first run; intervals and int8 have to be \
    calibrated again. If one of the networks does not predict uncertainty, neither does the mean.\n\n\
    Examples:\n  deepfusion weights average runs/video runs/mixed --out runs/mean\n  \
    deepfusion weights average runs/own street --shares 2,1 --out runs/careful      # less of what one drive taught"
)]
pub(crate) struct AverageArgs {
    /// Run folder or checkpoint in it; after the first also packed networks, and embedded ones by name.
    ///
    /// Of a run folder, the best checkpoint is taken, if there is one.
    #[arg(required = true, num_args = 2.., value_name = "RUN|NAME")]
    pub models: Vec<PathBuf>,
    /// How much each network counts: one positive number each, in the order given [default: all the same].
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    pub shares: Option<Vec<f64>>,
    /// New folder for the resulting run.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print what was averaged as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// `deepfusion weights pack`.
#[derive(Debug, Args)]
#[command(
    after_help = "Writes DIR/NAME.safetensors, which is the depth network alone (kernels rounded to bf16, vectors in f32), and the card \
    DIR/NAME.toml: the run's configuration, the names of its recordings, the run's evaluations of this checkpoint, licence and \
    SHA-256. The same run gives the same bytes. `--model` and `--init` take the .safetensors file; if both files are in \
    crates/deepfusion-weights/weights, they are built into the program.\n\n\
    Example:\n  deepfusion weights pack --model runs/street --name street --simulated-only --out packed"
)]
pub(crate) struct PackArgs {
    /// Run folder, or checkpoint in it.
    #[arg(long, value_name = "RUN")]
    pub model: PathBuf,
    /// Which checkpoint to pack [default: best, if there is one].
    #[arg(long, value_parser = names::checkpoint())]
    pub checkpoint: Option<CheckpointKind>,
    /// Name of the packed network, for `--model`: letters a to z, digits and dashes.
    #[arg(long, value_name = "NAME")]
    pub name: String,
    /// Output folder for the two files.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Note for the card.
    #[arg(long, value_name = "TEXT")]
    pub note: Option<String>,
    /// Recipe for the card: a file of recipes/, or a command.
    #[arg(long, value_name = "TEXT")]
    pub recipe: Option<String>,
    /// Licence for the card.
    #[arg(long, value_name = "TERMS", default_value = env!("CARGO_PKG_LICENSE"))]
    pub licence: String,
    /// State in the card that the network was trained on no real image, so that real recordings count as not seen in training.
    ///
    /// This is refused if the run, a run that it started from, or one that it is the mean of was trained on KITTI (raw, odometry, 360) or
    /// nuScenes. A warning names other recordings that nothing shows to be simulated, such as bags.
    #[arg(long)]
    pub simulated_only: bool,
    /// Replace existing files.
    #[arg(long)]
    pub overwrite: bool,
    /// Print the card as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
