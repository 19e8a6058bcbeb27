//! What each command does, one file per command.

#[cfg(feature = "train")]
mod ablate;
#[cfg(feature = "train")]
mod adapt;
mod bench;
mod calibrate;
mod clocks;
mod command_line;
mod compare;
mod completions;
mod config;
mod convert;
#[cfg(feature = "train")]
mod demo;
mod doctor;
mod eval;
#[cfg(feature = "train")]
mod eval_odometry;
mod eval_targets;
#[cfg(feature = "train")]
mod export;
mod export_gt;
mod import;
mod inspect;
mod live;
mod overview;
mod perceive;
mod predict;
#[cfg(feature = "train")]
mod recorder;
mod recordings;
#[cfg(feature = "train")]
mod resume;
mod simulate;
#[cfg(feature = "train")]
mod train;
mod view;
mod view_rerun;
mod warnings;
mod weights;

use crate::cli::{Command, ConfigCommand, DataCommand, WeightsCommand};
use crate::failure::Result;

/// Runs a command; without one, prints the overview.
pub(crate) fn run(command: Option<Command>) -> Result<()> {
    let Some(command) = command else {
        return overview::run();
    };
    match command {
        #[cfg(feature = "train")]
        Command::Demo(args) => demo::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Data(DataCommand::Inspect(args)) => inspect::run(&args),
        Command::Data(DataCommand::ExportGt(args)) => export_gt::run(&args),
        Command::Data(DataCommand::Convert(args)) => convert::run(&args),
        Command::Data(DataCommand::Import(args)) => import::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        #[cfg(feature = "train")]
        Command::Train(args) => train::run(&args),
        #[cfg(feature = "train")]
        Command::Adapt(args) => adapt::run(&args),
        Command::Config(ConfigCommand::Show(args)) => config::show(&args),
        #[cfg(feature = "train")]
        Command::Ablate(args) => ablate::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Compare(args) => compare::run(&args),
        #[cfg(feature = "train")]
        Command::EvalOdometry(args) => eval_odometry::run(&args),
        Command::EvalTargets(args) => eval_targets::run(&args),
        Command::Predict(args) => predict::run(&args),
        Command::Perceive(args) => perceive::run(&args),
        Command::View(args) => view::run(&args),
        #[cfg(feature = "train")]
        Command::Export(args) => export::run(&args),
        #[cfg(feature = "train")]
        Command::Weights(WeightsCommand::Import { files, out }) => {
            weights::import::run(&files, &out)
        }
        Command::Weights(WeightsCommand::Pack(args)) => weights::pack::run(&args),
        Command::Weights(WeightsCommand::Average(args)) => weights::average::run(&args),
        Command::Weights(WeightsCommand::Calibrate(args)) => weights::calibrate::run(&args),
        Command::Weights(WeightsCommand::List { json }) => weights::list::run(json),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Completions(args) => completions::run(&args),
    }
}
