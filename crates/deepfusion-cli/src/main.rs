//! The `deepfusion` command.

#![cfg_attr(
    not(feature = "train"),
    allow(
        dead_code,
        unused_imports,
        reason = "a build without training leaves out commands, not what they share"
    )
)]

mod allocator;
mod cli;
mod commands;
mod engine;
mod error;
mod failure;
mod interrupt;
mod jobs;
mod model;
mod output;
mod progress;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    output::init_logging();
    // Wrong arguments end here: clap says which, suggests the near one and exits with 2.
    let cli = cli::Cli::parse();
    progress::set_quiet(cli.quiet);
    match in_pool(|| commands::run(cli.command)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Runs `work` on one of rayon's threads: its parallel operations then start at once, where the main
/// thread would hand each of them over and sleep. A training step has a great many of them.
fn in_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    /// As large as the main thread's: the graph of a backward pass is deep.
    const STACK_BYTES: usize = 8 << 20;
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES);
    // A pool that exists already has the default stack, which release builds do not need.
    pool.build_global().ok();
    rayon::scope(|_| work())
}
