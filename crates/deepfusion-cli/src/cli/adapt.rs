use std::path::PathBuf;

use clap::{Args, ValueEnum};
use deepfusion_data::{Cameras, NamedTopic};

use super::device::device;
use super::values::{ClockOffset, not_negative};
use crate::devices::ComputeDevice;

/// `deepfusion adapt`.
#[derive(Debug, Args)]
#[command(
    after_help = "The end of each drive is held out. There, the network is judged without ground truth (see `eval`) before and after it has been \
    trained on the rest: how well frames explain each other, whether depths agree from frame to frame and with the mirrored image, \
    and the scale bias. If any of these gets worse by more than it varies by chance (the table's last column: 1 % of the reprojection error, \
    15 % of the disagreement of depths or half a percent of depth, 2 percent of bias), the result is refused: it is moved to OUT.refused, \
    and the exit code is 1.\n\n\
    The given network does not change. OUT is a run that other commands take as --model. --undo OUT makes OUT predict like the \
    network that it started from. If interrupted, repeat the command to continue.\n\n\
    Examples:\n  deepfusion adapt --data my-drive --out runs/mine\n  \
    deepfusion adapt --model runs/city --data kitti/2011_09_26 --steps 400 --out runs/kitti\n  \
    deepfusion adapt --undo runs/mine"
)]
pub(crate) struct AdaptArgs {
    /// Network to start from: a run, a checkpoint in it, or the name of an embedded network [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Data set whose metric scale to use, for a network trained on several.
    #[arg(long = "data-set", value_name = "NAME")]
    pub data_set: Option<String>,
    /// Drives to train on, with a speed; turns that were not recorded are estimated from the images.
    #[arg(long, value_name = "PATH", num_args = 1.., required_unless_present = "undo")]
    pub data: Vec<PathBuf>,
    /// New folder for the adapted network's run.
    #[arg(long, value_name = "DIR", required_unless_present = "undo")]
    pub out: Option<PathBuf>,
    /// Make an adapted network predict like the one that it started from; what it learned stays beside it.
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub undo: Option<PathBuf>,
    /// Training steps.
    #[arg(long, value_name = "N", default_value_t = 240)]
    pub steps: usize,
    /// Samples of the drive per step.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub batch: usize,
    /// Samples of simulated depth per step, which preserve what the network already knows; 0: none, and no uncertainty head.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub simulated: usize,
    /// Camera of the simulated streets: the drives' own, at the height above the road that their images show, or any.
    #[arg(long, value_name = "own|any", value_enum, default_value_t)]
    pub simulated_camera: SimulatedView,
    /// Largest learning rate.
    #[arg(long, value_name = "RATE", default_value_t = 5e-5)]
    pub learning_rate: f64,
    /// Share of each drive to hold out at its end, to judge the network on.
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, value_parser = held_out)]
    pub held_out: f64,
    /// Which cameras to use.
    ///
    /// If both are used and rectified, each is also a second view of the same moment (as in `train --stereo`), unless the given network was
    /// trained on drives without it; `--set stereo=false` turns that off. Drives with one camera may be among them.
    #[arg(long, value_name = "2|3|both", default_value = "2")]
    pub camera: Cameras,
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
    /// Uncertainty of the vehicle's speed in per cent (one standard error).
    #[arg(long, allow_negative_numbers = true, value_name = "PERCENT", default_value_t = 3.0, value_parser = not_negative)]
    pub speed_error: f64,
    /// Random seed.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Set a key of the configuration; may be repeated.
    ///
    /// For example `loss.smoothness=0.01` or `data.sets[0].learn=depth`; `deepfusion config show` prints all keys.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Device to compute on; with several GPUs add an index, such as cuda:1.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
    /// Print the results before and after as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Which camera sees the simulated streets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum SimulatedView {
    /// The drives' own cameras.
    #[default]
    Own,
    /// Any camera, as in the training of the embedded networks.
    Any,
}

/// A share from 0.05 to 0.5.
fn held_out(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if (0.05..=0.5).contains(&share) => Ok(share),
        _ => Err("not a share from 0.05 to 0.5".into()),
    }
}
