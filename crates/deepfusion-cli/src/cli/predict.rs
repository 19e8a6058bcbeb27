use std::path::PathBuf;

use clap::{ArgGroup, Args};
use deepfusion_jobs::outputs::{CloudLimits, DepthOutput, DepthOutputs};
use deepfusion_model::Preset;

use super::values::positive;
use super::{EngineArgs, PredictionArgs, Shard, Size, names};

/// `deepfusion predict`.
#[derive(Debug, Args)]
#[command(
    after_help = "A network sees metres through the focal length it was trained at; depth is corrected for the input's. \
    Without intrinsics the training camera's field of view is assumed, and the sidecar says so.\n\n\
    A run that was stopped goes on where it was: outputs that are complete are kept. An image that cannot be read is \
    named at the end; the others are done.\n\n\
    A live source (camera:0, rtsp://…, http://…, udp://…, or - for a stream on standard input) is opened by ffmpeg. Always its newest \
    frame is looked at; the others are skipped, and counted.\n\n\
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
    /// What to write for every image [default: depth-png,color; of videos and bags image, too].
    #[arg(long, value_parser = names::depth_output(), value_delimiter = ',')]
    pub save: Option<Vec<DepthOutput>>,
    /// Leave out points of the cloud beyond this depth, in metres.
    #[arg(long, value_name = "M", default_value_t = 80.0, value_parser = positive)]
    pub max_depth: f64,
    /// Leave out points of the cloud whose standard deviation is above this share of their depth (0.4: two fifths); of networks that
    /// say how sure they are.
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    pub max_sigma: Option<f64>,
    /// Do one shard of the work: the I-th of N (counted from 1) of the images in the order of their paths. Started
    /// with the same inputs and options, N such runs, at once and on any machines, do every image once.
    #[arg(
        long,
        value_name = "I/N",
        default_value = "1/1",
        hide_default_value = true
    )]
    pub shard: Shard,
    /// Print the sidecars as a JSON array on stdout; of a live source one a line, as they come.
    #[arg(long)]
    pub json: bool,
}

impl PredictArgs {
    /// What is kept of every image.
    pub(crate) fn outputs(&self) -> DepthOutputs {
        let limits = CloudLimits {
            max_depth_m: self.max_depth,
            max_sigma: self.max_sigma,
        };
        DepthOutputs::of(self.asked().iter().copied(), self.save.is_none(), limits)
    }

    /// What `--save` says.
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
    /// A run folder, a checkpoint in it, or the name of an embedded network (`weights list`) [default: street, where embedded].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// A preset's network with random weights [default with --size, and where no network is embedded: tiny].
    #[arg(long, value_parser = names::preset())]
    pub preset: Option<Preset>,
    /// Size of a preset's input [default: the preset's own].
    #[arg(long, value_name = "WxH", conflicts_with = "model")]
    pub size: Option<Size>,
    /// How often each stage is measured.
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub repeats: usize,
    /// Also show what each step of the fused engine takes.
    #[arg(long)]
    pub profile: bool,
    /// What runs the network.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
