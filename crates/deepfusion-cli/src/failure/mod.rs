//! How a command fails: `error: …`, what caused it, `hint: …`, and the exit code.

mod findings;
mod jobs;
mod libraries;

use std::error::Error;
use std::fmt;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use anstyle::{AnsiColor, Style};

pub use findings::in_options;
#[cfg(feature = "train")]
pub(crate) use jobs::option_of;
pub(crate) use libraries::set_in_file;

/// What a command returns.
pub(crate) type Result<T, E = Failure> = std::result::Result<T, E>;

/// Adds to an error what was being done, and with which file.
pub(crate) trait Context<T> {
    /// Puts `what` before an error.
    ///
    /// # Errors
    /// The same error, as a [`Failure`].
    fn context(self, what: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Failure>> Context<T> for std::result::Result<T, E> {
    fn context(self, what: impl Into<String>) -> Result<T> {
        self.map_err(|error| error.into().context(what))
    }
}

/// An error that a command can end with, in terms of the command line: a library names settings, this trait's methods the options
/// that set them.
pub(crate) trait Reportable: Error + Send + Sync + 'static {
    /// What is wrong.
    fn message(&self) -> String {
        self.to_string()
    }

    /// What to do about it, if that is known: the library's [`Hint`](deepfusion_hint::Hint), or which option does it.
    fn hint_in_options(&self) -> Option<String>;

    /// How the program ends.
    fn exit(&self) -> Exit {
        Exit::Failed
    }

    /// The missing file or folder, if that is the error.
    fn missing(&self) -> Option<&Path> {
        None
    }
}

/// The hint of an error that has none of its own.
const REPORT_BUG: &str =
    "if none of your inputs is at fault, this is a bug: please report it, with the command you ran";

/// The exit code of work that was stopped before it was done: the one that shells report for a program that Ctrl-C ended.
pub(crate) const STOPPED: u8 = 130;

/// How the program ends. `train && eval` and schedulers see only this code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Something failed.
    Failed,
    /// An argument is missing or wrong: clap's code.
    WrongArguments,
    /// Nothing failed, but the work was stopped.
    Stopped,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        match exit {
            Exit::Failed => Self::FAILURE,
            Exit::WrongArguments => Self::from(2),
            Exit::Stopped => Self::from(STOPPED),
        }
    }
}

/// Why a command failed: an error, and what was being done with which file.
#[derive(Debug)]
pub(crate) struct Failure {
    error: Box<dyn Reportable>,
    /// What was being done, the innermost first.
    contexts: Vec<String>,
}

impl<E: Reportable> From<E> for Failure {
    fn from(error: E) -> Self {
        Self {
            error: Box::new(error),
            contexts: Vec::new(),
        }
    }
}

/// What is wrong, without its causes.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.chain()[0])
    }
}

impl Failure {
    /// The same failure, with a further, outer context.
    #[must_use]
    pub(crate) fn context(mut self, what: impl Into<String>) -> Self {
        self.contexts.push(what.into());
        self
    }

    /// The error's own hint, if it has one.
    pub(crate) fn hint(&self) -> Option<String> {
        self.error.hint_in_options()
    }

    /// The missing file or folder, if that is the error.
    pub(crate) fn missing(&self) -> Option<&Path> {
        self.error.missing()
    }

    /// The failure and its causes in one line.
    pub(crate) fn one_line(&self) -> String {
        let mut chain = self.chain().into_iter();
        let mut text = chain.next().unwrap_or_default();
        for cause in chain {
            // Many messages already contain their cause's.
            if !text.contains(&cause) {
                text += &format!(": {cause}");
            }
        }
        text
    }

    /// Prints the failure on stderr and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        const ERROR: Style = AnsiColor::Red.on_default().bold();
        const HINT: Style = AnsiColor::Cyan.on_default().bold();
        let mut chain = self.chain().into_iter();
        let mut last = chain.next().unwrap_or_default();
        let mut text = format!("{ERROR}error:{ERROR:#} {last}\n");
        for cause in chain {
            // Many messages already contain their cause's.
            if !last.contains(&cause) {
                text += &format!("  because: {cause}\n");
                last = cause;
            }
        }
        let hint = self.hint();
        let hint = hint.as_deref().unwrap_or(REPORT_BUG);
        text += &format!("{HINT}hint:{HINT:#} {hint}\n");
        // If stderr is closed, the exit code still reports the failure.
        let _ = anstream::stderr().write_all(text.as_bytes());
        self.error.exit().into()
    }

    /// What is wrong and its causes, the outermost first.
    fn chain(&self) -> Vec<String> {
        let mut chain: Vec<String> = self.contexts.iter().rev().cloned().collect();
        chain.push(self.error.message());
        let causes = std::iter::successors(self.error.source(), |&cause| cause.source());
        chain.extend(causes.map(ToString::to_string));
        chain
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::CliError;
    use std::io::ErrorKind;
    use std::path::PathBuf;

    /// Every kind of error tells its reader what to do next.
    #[test]
    fn every_error_has_a_hint() {
        let full = std::io::Error::from(ErrorKind::StorageFull);
        let full = Failure::from(full).context("log.csv");
        assert!(full.hint().unwrap().contains("disk is full"));
        let quota = ErrorKind::QuotaExceeded.into();
        let wrapped = Failure::from(deepfusion_data::Error::file(Path::new("log.csv"), quota));
        assert!(wrapped.hint().unwrap().contains("disk is full"));
        let unwritten = serde_json::to_writer(&mut [0_u8; 0][..], &7).unwrap_err();
        let lost = deepfusion_data::Error::file(Path::new("a.png"), ErrorKind::TimedOut.into());
        for failure in [Failure::from(unwritten), Failure::from(lost)] {
            assert!(failure.hint().unwrap().contains("check the disk"));
        }
        let foreign = Failure::from("?".parse::<toml::Table>().unwrap_err());
        assert_eq!(foreign.hint(), None);
        let expected = deepfusion_model::ExpectedSetting::AtLeastOne;
        let config = deepfusion_model::Error::config("batch", expected, "0".to_owned());
        assert!(Failure::from(config).hint().unwrap().contains("batch"));
        let images = deepfusion_jobs::Error::NoImages { input: "x".into() };
        assert!(Failure::from(images).hint().is_some());
    }

    #[test]
    fn missing_recordings_name_their_option() {
        use deepfusion_model::{Error, ExpectedSetting, FoundSetting};
        let error = Error::config("data", ExpectedSetting::Recordings, FoundSetting::Nothing);
        assert_eq!(
            Failure::from(error).to_string(),
            "setting `data`: expected --data, or data.paths or [[data.sets]] in the config file, found none"
        );
    }

    #[test]
    fn an_unusable_inertial_unit_names_the_option_that_leaves_it_out() {
        let (found, norm) = ([0.0; 3], 0.0);
        let error = deepfusion_data::Error::InertialUnit {
            path: "drive.bag".into(),
            source: Box::new(deepfusion_motion::Error::NotGravity { found, norm }),
            config: "drive.toml".into(),
        };
        let hint = Failure::from(error).hint().unwrap();
        assert!(hint.contains("--topic imu=none"), "{hint}");
        assert!(hint.contains("in drive.toml"), "{hint}");
    }

    #[test]
    fn clocks_that_cannot_be_compared_name_the_option_for_the_offset() {
        let drive = "monday".to_owned();
        let error = deepfusion_doctor::NoCameraAhead::NoSpeeds { drive };
        let hint = Failure::from(error).hint().unwrap();
        assert!(hint.contains("--clock-offset MS"), "{hint}");
    }

    #[test]
    fn causes_follow_the_failure_and_are_not_repeated() {
        let system = std::io::Error::from(ErrorKind::NotFound);
        let cause = system.to_string();
        let failure = Failure::from(system).context("log.csv").context("run");
        assert_eq!(failure.to_string(), "run");
        assert_eq!(failure.one_line(), format!("run: log.csv: {cause}"));
        let path = PathBuf::from("a.png");
        let error = deepfusion_data::Error::file(&path, ErrorKind::PermissionDenied.into());
        let message = error.to_string();
        assert_eq!(Failure::from(error).one_line(), message);
    }

    #[test]
    fn stopped_work_is_neither_done_nor_failed() {
        let go_on = String::new();
        let (step, steps) = (3, 9);
        let stopped = [
            CliError::Stopped { step, steps, go_on },
            CliError::Ended { what: "the demo" },
            CliError::Interrupted {
                done: 1,
                total: 2,
                resumes: true,
            },
        ];
        for error in stopped {
            assert_eq!(error.exit(), Exit::Stopped);
        }
        let path = PathBuf::from("a.rrd");
        let (done, total) = (1, 2);
        let view = deepfusion_view::Error::Stopped { path, done, total };
        let view = Failure::from(view).context("view");
        assert_eq!(view.error.exit(), Exit::Stopped);
        let simulated = deepfusion_sim::Error::Stopped { done, total };
        assert_eq!(simulated.exit(), Exit::Stopped);
        let converted = deepfusion_data::Error::Stopped { done, total };
        assert_eq!(converted.exit(), Exit::Stopped);
        assert_eq!(CliError::NoMedia.exit(), Exit::Failed);
        assert_eq!(CliError::NoModelGiven.exit(), Exit::WrongArguments);
    }
}
