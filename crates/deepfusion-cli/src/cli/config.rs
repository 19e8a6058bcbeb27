use std::ffi::OsStr;
use std::path::Path;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Args, Command, Subcommand};
use deepfusion_model::{Preset, RunFolder};

use super::device::device;
use super::names;
use crate::devices::ComputeDevice;

/// `deepfusion config …`.
#[derive(Debug, Subcommand)]
pub(crate) enum ConfigCommand {
    /// Print the whole configuration of a preset or a run as TOML, with a line on each key.
    Show(ShowArgs),
}

/// `deepfusion config show`.
#[derive(Debug, Args)]
#[command(
    after_help = "The output is a file for `train --config`. Such a file may also contain just a preset and the keys in which it differs.\n\n\
    Examples:\n  deepfusion config show light > light.toml\n  deepfusion config show tiny --set loss.smoothness=0.01 --set batch=8\n  deepfusion config show runs/first"
)]
pub(crate) struct ShowArgs {
    /// Preset, or run folder: the configuration that the run was trained with.
    #[arg(value_name = "PRESET|RUN", value_parser = PresetOrRun, default_value = "tiny")]
    pub of: ConfigSource,
    /// Set a key, as in `train`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Device to train on; a preset's sizes depend on it.
    #[arg(long, value_parser = device(), default_value_t)]
    pub device: ComputeDevice,
}

/// The source of the configuration to show.
#[derive(Debug, Clone)]
pub(crate) enum ConfigSource {
    Preset(Preset),
    Run(RunFolder),
}

/// A preset's name, else a folder with a run in it.
#[derive(Clone)]
struct PresetOrRun;

impl TypedValueParser for PresetOrRun {
    type Value = ConfigSource;

    fn parse_ref(
        &self,
        command: &Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<ConfigSource, clap::Error> {
        let preset = names::preset().parse_ref(command, arg, value);
        preset.map(ConfigSource::Preset).or_else(|error| {
            let run = RunFolder::open(Path::new(value));
            run.map(|(run, _)| ConfigSource::Run(run))
                .map_err(|_| error)
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let names: Vec<_> = names::preset().possible_values()?.collect();
        Some(Box::new(names.into_iter()))
    }
}
