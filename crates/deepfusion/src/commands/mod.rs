//! What each command does, one file a command.

mod ablate;
mod bench;
mod compare;
mod confidence;
mod config;
mod convert;
mod demo;
pub mod device;
mod division;
mod doctor;
mod eval;
mod eval_odometry;
mod eval_targets;
mod evaluate;
mod export;
mod export_gt;
mod held_out;
mod inspect;
mod known_pixels;
mod live;
mod outlook;
mod overview;
mod perceive;
mod predict;
mod recorder;
mod remarks;
mod resume;
mod run_report;
mod scene;
mod simulate;
mod start;
mod train;
pub mod uncertainty;
mod used_checkpoint;
mod view;
mod view_rerun;
mod weights;

use anyhow::Result;

use crate::cli::{Command, ConfigCommand, DataCommand, WeightsCommand};

/// Runs what was asked for.
pub fn run(command: Option<Command>) -> Result<()> {
    let Some(command) = command else {
        return overview::run();
    };
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Data(DataCommand::Inspect(args)) => inspect::run(&args),
        Command::Data(DataCommand::ExportGt(args)) => export_gt::run(&args),
        Command::Data(DataCommand::Convert(args)) => convert::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Config(ConfigCommand::Show(args)) => config::show(&args),
        Command::Ablate(args) => ablate::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::EvalOdometry(args) => eval_odometry::run(&args),
        Command::EvalTargets(args) => eval_targets::run(&args),
        Command::Predict(args) => predict::run(&args),
        Command::Perceive(args) => perceive::run(&args),
        Command::View(args) => view::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Weights(WeightsCommand::Import { files, out }) => {
            weights::import::run(&files, &out)
        }
        Command::Weights(WeightsCommand::Pack(args)) => weights::pack::run(&args),
        Command::Weights(WeightsCommand::List { json }) => weights::list::run(json),
        Command::Bench(args) => bench::run(&args),
    }
}
