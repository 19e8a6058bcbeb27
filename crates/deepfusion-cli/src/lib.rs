//! The `deepfusion` command, for the program of that name and for the Python package.

#![cfg_attr(
    not(feature = "train"),
    allow(
        dead_code,
        unused_imports,
        reason = "a build without training leaves out commands, but not the code that they share"
    )
)]

mod allocator;
mod cli;
mod commands;
mod devices;
mod engine;
mod error;
mod failure;
mod forked;
mod interrupt;
mod model;
mod output;
mod progress;

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::{Once, OnceLock};

use clap::Parser;

pub use allocator::keep_memory;
pub use failure::in_options;
pub use forked::{in_this_process, loaded_here};

/// The command line that is run, for reports. In Python it differs from the process's own.
static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Runs a command line, the program's name first, as the program would: data on stdout, warnings and progress on stderr. Commands that
/// can be interrupted take over Ctrl-C. Meant for a process that does nothing else.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    static LOGGING: Once = Once::new();
    LOGGING.call_once(output::init_logging);
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let parsed = cli::Cli::try_parse_from(&arguments);
    ARGUMENTS.get_or_init(|| arguments);
    let cli = match parsed {
        Ok(cli) => cli,
        // Wrong arguments end here, as help does: clap names them, suggests similar ones and returns exit code 2.
        Err(answer) => {
            // If stderr is closed, the exit code still reports it.
            let _ = answer.print();
            let code = u8::try_from(answer.exit_code());
            return code.map_or(ExitCode::FAILURE, ExitCode::from);
        }
    };
    progress::set_quiet(cli.quiet);
    match in_pool(|| commands::run(cli.command)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// As large as the main thread's stack: the graph of a backward pass is deep.
const STACK_BYTES: usize = 8 << 20;

/// Runs `work` on one of rayon's threads. Its parallel operations, of which a training step has very many, then start at once; the main
/// thread would hand each of them over and sleep. In the child of a fork it is a thread of that process's own pool ([`in_this_process`]).
pub fn in_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    if let Some(pool) = forked::pool() {
        return pool.install(work);
    }
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES);
    // A pool that exists already has the default stack, which release builds do not need.
    pool.build_global().ok();
    rayon::scope(|_| work())
}

/// As [`in_pool`], on the threads of a pool that nothing else uses and that ends with `work`. If no such pool can be made, in the common one.
pub fn in_own_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new()
        .stack_size(STACK_BYTES)
        .build()
    {
        Ok(pool) => pool.install(work),
        Err(_) => in_pool(work),
    }
}

/// The arguments after the program's name.
fn arguments() -> impl Iterator<Item = String> {
    let all = ARGUMENTS.get().map_or(&[][..], Vec::as_slice);
    all.iter()
        .skip(1)
        .map(|word| word.to_string_lossy().into_owned())
}
