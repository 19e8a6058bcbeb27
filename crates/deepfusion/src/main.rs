//! The `deepfusion` command.

mod allocator;
mod cli;
mod commands;
mod error;
mod output;
mod progress;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    allocator::keep_memory();
    output::init_logging();
    // Wrong arguments end here: clap says which, suggests the near one and exits with 2.
    let cli = cli::Cli::parse();
    progress::set_quiet(cli.quiet);
    match commands::run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => error::report(&problem),
    }
}
