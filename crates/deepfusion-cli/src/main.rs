//! The `deepfusion` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    deepfusion_cli::run(std::env::args_os())
}
