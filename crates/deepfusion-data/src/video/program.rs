//! Running ffmpeg and ffprobe.

use crate::{Error, Result};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// What most want of it.
pub(super) const READ: &str = "read videos";
/// And what some.
pub(super) const WRITE: &str = "write videos";

/// Longest complaint that is passed on, in characters.
const LONGEST: usize = 400;

/// Runs a program on `file` in a folder, to do `what`, and gives what it printed.
///
/// # Errors
/// [`Error::Program`] where it is not installed, or fails.
pub(super) fn run<S: AsRef<OsStr>>(
    program: &'static str,
    arguments: &[S],
    (file, what): (&Path, &str),
    folder: &Path,
) -> Result<Vec<u8>> {
    let failed = |problem: String, remedy| Error::Program {
        path: file.to_owned(),
        program,
        problem,
        remedy,
    };
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| {
            let remedy = match what {
                WRITE => {
                    "install ffmpeg so that it is on the PATH, or save the pictures and make the video elsewhere"
                }
                _ => {
                    "install ffmpeg (it brings ffprobe) so that both are on the PATH, or extract the frames elsewhere \
                     and give their folder"
                }
            };
            not_started(file, program, &e, what, remedy)
        })?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said: String = said.trim().chars().take(LONGEST).collect();
    Err(failed(
        format!("failed: {said}"),
        "see whether the disk is full and, of a video that is read, whether it plays; a newer ffmpeg knows more codecs",
    ))
}

/// The error of a program that could not be started; `what` it was to do, and `remedy` where it is not installed.
pub(crate) fn not_started(
    file: &Path,
    program: &'static str,
    error: &std::io::Error,
    what: &str,
    remedy: &'static str,
) -> Error {
    let (problem, remedy) = match error.kind() {
        std::io::ErrorKind::NotFound => {
            (format!("is needed to {what} and is not installed"), remedy)
        }
        _ => (
            format!("cannot be run: {error}"),
            "check that it can be run from a terminal",
        ),
    };
    Error::Program {
        path: file.to_owned(),
        program,
        problem,
        remedy,
    }
}
