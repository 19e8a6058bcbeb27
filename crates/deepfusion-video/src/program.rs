//! Running ffmpeg and ffprobe.

use crate::{Error, Result};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// What most want of it.
pub(crate) const READ: &str = "read videos";
/// And what some.
pub(crate) const WRITE: &str = "write videos";

/// Longest complaint that is passed on, in characters.
const LONGEST: usize = 400;

/// What a program that succeeded printed.
pub(crate) struct Printed {
    /// On its standard output.
    pub(crate) text: Vec<u8>,
    /// On its standard error, shortened.
    pub(crate) complaint: String,
}

/// Runs a program on `file` in a folder, to do `what`, and gives what it printed on its standard output.
///
/// # Errors
/// [`Error::Program`] where it is not installed, or fails.
pub(crate) fn run<S: AsRef<OsStr>>(
    program: &'static str,
    arguments: &[S],
    (file, what): (&Path, &str),
    folder: &Path,
) -> Result<Vec<u8>> {
    Ok(output(program, arguments, (file, what), folder)?.text)
}

/// As [`run`], with what it complained of.
///
/// # Errors
/// As [`run`].
pub(crate) fn output<S: AsRef<OsStr>>(
    program: &'static str,
    arguments: &[S],
    (file, what): (&Path, &str),
    folder: &Path,
) -> Result<Printed> {
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
    let said = String::from_utf8_lossy(&output.stderr);
    let complaint: String = said.trim().chars().take(LONGEST).collect();
    if output.status.success() {
        return Ok(Printed {
            text: output.stdout,
            complaint,
        });
    }
    Err(Error::Program {
        path: file.to_owned(),
        program,
        problem: format!("failed: {complaint}"),
        remedy: match what {
            WRITE => "see whether the disk is full; a newer ffmpeg may have an encoder for MP4",
            _ => "play the file to see whether it is whole; a newer ffmpeg may know its codec",
        },
    })
}

/// Runs ffmpeg with `-fps_mode`, or as before ffmpeg 5.1, where the option had another name.
///
/// # Errors
/// Those of `run`.
pub(crate) fn in_either_words<T>(run: impl Fn(&str) -> Result<T>) -> Result<T> {
    match run("-fps_mode") {
        Err(Error::Program { problem, .. }) if problem.contains("fps_mode") => run("-vsync"),
        other => other,
    }
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
