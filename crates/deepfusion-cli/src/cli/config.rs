use clap::{Args, Subcommand};
use deepfusion_model::Preset;

use super::device::device;
use super::names;
use crate::devices::ComputeDevice;

/// `deepfusion config …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ConfigCommand {
    /// A preset's whole configuration as TOML, with a line on each key.
    Show(ShowArgs),
}

/// `deepfusion config show`.
#[derive(Debug, Args)]
#[command(
    after_help = "What it prints is a file for `train --config`. Such a file may also name a preset and only the keys in which it differs.\n\n\
    Examples:\n  deepfusion config show light > light.toml\n  deepfusion config show tiny --set loss.smoothness=0.01 --set batch=8"
)]
pub(crate) struct ShowArgs {
    /// The preset.
    #[arg(value_parser = names::preset(), default_value = "tiny")]
    pub preset: Preset,
    /// A key and its value, as for `train`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// What is to be trained on: a preset's sizes follow it.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
}
