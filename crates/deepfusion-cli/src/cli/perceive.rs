use std::path::PathBuf;

use clap::Args;
use deepfusion_jobs::outputs::{CloudLimits, DepthOutputs, TargetOutput};

use super::live::HEADING;
use super::values::{not_negative, positive};
use super::{InstanceArgs, PredictionArgs, names};

/// `deepfusion perceive`.
#[derive(Debug, Args)]
#[command(
    after_help = "In recordings with times, speed and yaw rate, targets are tracked from frame to frame: they keep their id and have a velocity \
    over ground. Single images are independent of each other.\n\n\
    Each frame gets a file NAME_targets.json; targets.jsonl has all of them, one per line.\n\n\
    A live source (camera:0, rtsp://…, http://…, udp://…, or - for a stream on standard input) is read through ffmpeg. The network \
    always takes the newest frame; the frames it skips are counted. Targets are tracked if --speed says how the camera moves.\n\n\
    Examples:\n  deepfusion perceive --model runs/train-1 kitti/2011_09_26/2011_09_26_drive_0005_sync --out targets\n  \
    deepfusion perceive --model runs/train-1 drive.bag --out targets --save overlay,birds-eye\n  \
    deepfusion perceive --model runs/train-1 street.jpg --intrinsics 721.5,721.5,609.6,172.9 --out targets\n  \
    deepfusion perceive --model runs/train-1 camera:0 --calib camera.yaml --speed 0 --out targets\n  \
    deepfusion perceive --model runs/train-1 rtsp://192.168.1.20/stream --calib camera.yaml --json --out targets"
)]
pub(crate) struct PerceiveArgs {
    /// Which images, through which network, to where.
    #[command(flatten)]
    pub prediction: PredictionArgs,
    /// What to write for each frame, beside its targets.
    #[arg(long, value_parser = names::target_output(), value_delimiter = ',', default_values = ["depth-png", "overlay"])]
    pub save: Vec<TargetOutput>,
    /// Largest depth to look at, in metres [default: 60, or the value in --config].
    #[arg(long, allow_negative_numbers = true, value_name = "M", value_parser = positive)]
    pub max_depth: Option<f64>,
    /// Perception settings (TOML); missing keys keep their defaults.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Masks of a user's model.
    #[command(flatten)]
    pub masks: InstanceArgs,
    /// Speed of the camera's vehicle, driving straight on, in m/s (0 for a fixed camera); targets are then tracked.
    #[arg(long, allow_negative_numbers = true, value_name = "M/S", help_heading = HEADING, value_parser = not_negative)]
    pub speed: Option<f64>,
    /// Print one JSON object per frame on stdout, as it comes.
    #[arg(long)]
    pub json: bool,
}

impl PerceiveArgs {
    /// The outputs to write of the depth in which targets are found.
    pub(crate) fn outputs(&self, max_depth_m: f64) -> DepthOutputs {
        let limits = CloudLimits {
            max_depth_m,
            max_sigma: None,
        };
        let asked = self.save.iter().filter_map(|save| save.of_prediction());
        DepthOutputs::of(asked, true, limits)
    }
}
