//! Running ffmpeg and ffprobe.

use crate::{Error, ProgramProblem, ProgramTask, Result};
use std::ffi::OsStr;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Length to which a program's messages are shortened, in characters.
const LONGEST: usize = 400;

/// The output of a program.
pub(crate) struct Printed {
    /// Its standard output.
    pub(crate) text: Vec<u8>,
    /// Its standard error, shortened.
    pub(crate) complaint: String,
    /// Whether it ended successfully.
    pub(crate) succeeded: bool,
}

/// Runs a program on `file` in a folder, for a task, and returns its standard output.
///
/// # Errors
/// [`Error::Program`] if it is not installed, or fails.
pub(crate) fn run<S: AsRef<OsStr>>(
    program: &'static str,
    arguments: &[S],
    (file, task): (&Path, ProgramTask),
    folder: &Path,
) -> Result<Vec<u8>> {
    let printed = outcome(program, arguments, (file, task), folder, None)?;
    Ok(printed.succeeded(program, (file, task))?.text)
}

impl Printed {
    /// The output, if the program ended successfully.
    ///
    /// # Errors
    /// [`Error::Program`].
    pub(crate) fn succeeded(
        self,
        program: &'static str,
        (file, task): (&Path, ProgramTask),
    ) -> Result<Self> {
        if self.succeeded {
            return Ok(self);
        }
        Err(Error::Program {
            path: file.to_owned(),
            program,
            problem: ProgramProblem::Failed {
                task,
                message: self.complaint,
            },
        })
    }

    /// Whether the program failed because it does not know an option. ffmpeg's exit code is always the same, so its message is searched.
    fn does_not_know(&self, option: &str) -> bool {
        !self.succeeded && self.complaint.contains(option)
    }
}

/// Runs a program to its end, whether it succeeds or not, with `input` on its standard input.
///
/// # Errors
/// [`Error::Program`] if it is not installed.
pub(crate) fn outcome<S: AsRef<OsStr>>(
    program: &'static str,
    arguments: &[S],
    (file, task): (&Path, ProgramTask),
    folder: &Path,
    input: Option<&[u8]>,
) -> Result<Printed> {
    let failed = |e| not_started(file, program, e, task);
    let mut child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(if input.is_some() {
            Stdio::piped()
        } else {
            Stdio::null()
        })
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let pipe = child.stdin.take();
    let output = std::thread::scope(|scope| {
        // On another thread than the reading, or each could wait for the other.
        scope.spawn(move || {
            if let (Some(mut pipe), Some(bytes)) = (pipe, input) {
                // A program that ends early does not read all of it; its exit status says why.
                let _ = pipe.write_all(bytes);
            }
        });
        child.wait_with_output()
    })
    .map_err(failed)?;
    let message = String::from_utf8_lossy(&output.stderr);
    Ok(Printed {
        complaint: message.trim().chars().take(LONGEST).collect(),
        text: output.stdout,
        succeeded: output.status.success(),
    })
}

/// Runs ffmpeg with `-fps_mode`, or with the option's name from before ffmpeg 5.1.
///
/// # Errors
/// Those of `run`.
pub(crate) fn with_either_option_name(run: impl Fn(&str) -> Result<Printed>) -> Result<Printed> {
    let printed = run("-fps_mode")?;
    if printed.does_not_know("fps_mode") {
        run("-vsync")
    } else {
        Ok(printed)
    }
}

/// The error of a program that could not be started.
pub(crate) fn not_started(
    file: &Path,
    program: &'static str,
    error: std::io::Error,
    task: ProgramTask,
) -> Error {
    Error::Program {
        path: file.to_owned(),
        program,
        problem: match error.kind() {
            std::io::ErrorKind::NotFound => ProgramProblem::NotInstalled(task),
            _ => ProgramProblem::NotRun(error),
        },
    }
}
