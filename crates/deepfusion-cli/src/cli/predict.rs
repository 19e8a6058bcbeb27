use std::path::PathBuf;

use clap::{ArgGroup, Args};
use deepfusion_jobs::outputs::{CloudLimits, DepthOutput, DepthOutputs};
use deepfusion_model::Preset;

use super::values::positive;
use super::{EngineArgs, PredictionArgs, Shard, Size, names};

/// `deepfusion predict`.
#[derive(Debug, Args)]
#[command(
    after_help = "A network's metres hold for the focal length that it was trained with, so depth is corrected for the focal length of the input. \
    Without intrinsics, the training camera's field of view is assumed, and the sidecar says so.\n\n\
    To resume a stopped run, repeat the command: complete outputs are kept. Images that cannot be read are listed at the end; all \
    others are predicted.\n\n\
    A live source (camera:0, rtsp://…, http://…, udp://…, or - for a stream on standard input) is read through ffmpeg. The network \
    always takes the newest frame; the frames it skips are counted.\n\n\
    Examples:\n  deepfusion predict --model runs/train-1 street.jpg --out depth\n  \
    deepfusion predict --model runs/train-1 'drive/*.png' --save npy,ply --out depth\n  \
    deepfusion predict --model runs/train-1 drive.bag --save video --out depth\n  \
    deepfusion predict --model runs/train-1 drive --out depth --shard 1/2   # and 2/2 elsewhere\n  \
    deepfusion predict --model runs/train-1 camera:0 --calib camera.yaml --frames 100 --out depth"
)]
pub(crate) struct PredictArgs {
    /// Which images, through which network, to where.
    #[command(flatten)]
    pub prediction: PredictionArgs,
    /// What to write for each image [default: depth-png,color; for videos and bags also image].
    #[arg(long, value_parser = names::depth_output(), value_delimiter = ',')]
    pub save: Option<Vec<DepthOutput>>,
    /// Leave out cloud points beyond this depth, in metres.
    #[arg(long, allow_negative_numbers = true, value_name = "M", default_value_t = 80.0, value_parser = positive)]
    pub max_depth: f64,
    /// Leave out cloud points whose standard deviation is above this share of their depth, such as 0.4.
    ///
    /// Needs a network that predicts uncertainty.
    #[arg(long, allow_negative_numbers = true, value_name = "SHARE", value_parser = positive)]
    pub max_sigma: Option<f64>,
    /// Predict only shard I of N: every N-th image, in the order of the paths; I counts from 1.
    ///
    /// Start N such runs with the same inputs and options, at once or one after the other, on any machines. Together they predict every
    /// image once.
    #[arg(
        long,
        value_name = "I/N",
        default_value = "1/1",
        hide_default_value = true
    )]
    pub shard: Shard,
    /// Print the sidecars as a JSON array on stdout; for a live source one per line, as they come.
    #[arg(long)]
    pub json: bool,
}

impl PredictArgs {
    /// The outputs to write for every image.
    pub(crate) fn outputs(&self) -> DepthOutputs {
        let limits = CloudLimits {
            max_depth_m: self.max_depth,
            max_sigma: self.max_sigma,
        };
        DepthOutputs::of(self.asked().iter().copied(), self.save.is_none(), limits)
    }

    /// The outputs of `--save`.
    fn asked(&self) -> &[DepthOutput] {
        let default = &[DepthOutput::DepthPng, DepthOutput::Color];
        self.save.as_deref().unwrap_or(default)
    }

    /// Whether a cloud is wanted.
    pub(crate) fn cloud(&self) -> bool {
        self.asked().iter().any(|save| save.is_cloud())
    }

    /// Whether videos are wanted.
    pub(crate) fn video(&self) -> bool {
        self.asked().contains(&DepthOutput::Video)
    }
}

/// `deepfusion bench`.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("network").args(["model", "preset"])),
    after_help = "Example:\n  deepfusion bench --preset light --size 640x192"
)]
pub(crate) struct BenchArgs {
    /// Run folder, checkpoint in it, or name of an embedded network (`weights list`) [default: street, if embedded].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Use a preset's network with random weights [default with --size, or if no network is embedded: tiny].
    #[arg(long, value_parser = names::preset())]
    pub preset: Option<Preset>,
    /// Input size of the preset's network [default: the preset's own].
    #[arg(long, value_name = "WxH", conflicts_with = "model")]
    pub size: Option<Size>,
    /// How often to measure each stage.
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub repeats: usize,
    /// Also show the time of each step of the fused engine.
    #[arg(long)]
    pub profile: bool,
    /// What runs the network.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
