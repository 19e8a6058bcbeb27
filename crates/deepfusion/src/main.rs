//! The `deepfusion` command.

mod cli;
mod commands;
mod error;
mod output;
mod progress;

use std::process::ExitCode;

use clap::Parser;

/// Training allocates and frees megabytes in every operation; the system's allocator gives each of
/// them back to the kernel and asks again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    output::init_logging();
    // Wrong arguments end here: clap says which, suggests the near one and exits with 2.
    let cli = cli::Cli::parse();
    progress::set_quiet(cli.quiet);
    match commands::run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => error::report(&problem),
    }
}
