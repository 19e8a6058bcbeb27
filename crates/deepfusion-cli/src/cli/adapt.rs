use std::path::PathBuf;

use clap::{Args, ValueEnum};
use deepfusion_data::{Cameras, NamedTopic};

use super::device::device;
use super::values::{ClockOffset, not_negative};
use crate::devices::ComputeDevice;

/// `deepfusion adapt`.
#[derive(Debug, Args)]
#[command(
    after_help = "The end of each drive is held out. The network is judged there without ground truth before and after it has learned on the rest \
    (see `eval`): how well frames explain each other, whether depths agree from frame to frame and with the mirrored image, and the bias of the \
    metre. Where any of these gets worse by more than it varies anyway (the table's last column: 1 % of the reprojection error, 15 % of a \
    disagreement of depths or half a percent of depth, 2 percent of bias) the result is refused: it is moved to OUT.refused, and the exit code is 1.\n\n\
    The network that was given stays as it is. OUT is a run: other commands take it as --model. --undo OUT makes OUT predict as it did before. \
    Interrupted, the same command goes on.\n\n\
    Examples:\n  deepfusion adapt --data my-drive --out runs/mine\n  \
    deepfusion adapt --model runs/city --data kitti/2011_09_26 --steps 400 --out runs/kitti\n  \
    deepfusion adapt --undo runs/mine"
)]
pub(crate) struct AdaptArgs {
    /// The network to begin from: a run, a checkpoint in it, or the name of an embedded network [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// The data set whose metric scale to use, for a network trained on several.
    #[arg(long = "data-set", value_name = "NAME")]
    pub data_set: Option<String>,
    /// Drives to learn on, with a speed; turns that are not recorded are taken from the images.
    #[arg(long, value_name = "PATH", num_args = 1.., required_unless_present = "undo")]
    pub data: Vec<PathBuf>,
    /// Folder of the adapted network's run, new.
    #[arg(long, value_name = "DIR", required_unless_present = "undo")]
    pub out: Option<PathBuf>,
    /// Make an adapted network predict as the one it began from; what was learned stays beside it.
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub undo: Option<PathBuf>,
    /// Steps of learning.
    #[arg(long, value_name = "N", default_value_t = 240)]
    pub steps: usize,
    /// Samples of the drive a step.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub batch: usize,
    /// Samples of simulated depth a step, which keep what the network knows already; 0: none, and no head for uncertainty.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub simulated: usize,
    /// The camera that sees the simulated streets: the drives' own, at its height above the road in their images, or any.
    #[arg(long, value_name = "own|any", value_enum, default_value_t)]
    pub simulated_camera: SimulatedView,
    /// The largest learning rate.
    #[arg(long, value_name = "RATE", default_value_t = 5e-5)]
    pub learning_rate: f64,
    /// Share of each drive's end to judge on.
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, value_parser = held_out)]
    pub held_out: f64,
    /// Which cameras. Where rectified cameras are both taken, each is also a second view of the same moment (as `train --stereo`), unless
    /// the given network learned from drives without it; `--set stereo=false` turns that off. Drives with one camera may stand beside.
    #[arg(long, value_name = "2|3|both", default_value = "2")]
    pub camera: Cameras,
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
    /// What the vehicle's speed may be off by (one standard error).
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = not_negative)]
    pub speed_error: f64,
    /// Fixes everything that is random.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Any key of the configuration, as `loss.smoothness=0.01` or `data.sets[0].learn=depth` (`deepfusion config show` prints them all); may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Where to compute; one of several GPUs by its index, as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Print before and after as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Which camera sees the simulated streets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum SimulatedView {
    /// The drives' own cameras.
    #[default]
    Own,
    /// Any camera, as the embedded networks learned.
    Any,
}

/// A share from 0.05 to 0.5.
fn held_out(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if (0.05..=0.5).contains(&share) => Ok(share),
        _ => Err("not a share from 0.05 to 0.5".into()),
    }
}
