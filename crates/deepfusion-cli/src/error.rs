//! How failures are told: `error: …`, what caused it, `hint: …`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anstyle::{AnsiColor, Style};

use crate::{interrupt, jobs};

/// Failures that only the command line knows.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Something that would be overwritten.
    #[error("{}: is there already", path.display())]
    Exists {
        /// The file or folder.
        path: PathBuf,
        /// The option that allows it, or what else to do.
        remedy: &'static str,
    },
    /// A device whose backend was not compiled in.
    #[error("this build has no `{device}` backend")]
    NoBackend {
        /// The device's name.
        device: &'static str,
    },
    /// A file of a viewer that was not compiled in.
    #[cfg(not(feature = "rerun"))]
    #[error("this build writes no files for the rerun viewer")]
    NoRerun,
    /// A folder or pattern without images.
    #[error("{input}: no image (.png, .jpg, .jpeg) there")]
    NoImages {
        /// What was given.
        input: String,
    },
    /// No network named, and none embedded.
    #[error("no `--model` is given, and this build has no embedded network to take instead")]
    NoModelGiven,
    /// Something that only the training framework can do, in a build without it.
    #[cfg_attr(
        feature = "train",
        allow(dead_code, reason = "builds with training can do it")
    )]
    #[error("{what} needs the training framework, which this build leaves out")]
    BuiltWithoutTraining {
        /// What was asked for.
        what: &'static str,
    },
    /// Something that is kept in a run's folder, of a network that has none.
    #[error("{option}: `{model}` has no run's folder to keep it in")]
    NoRunFolder {
        /// What was asked for.
        option: &'static str,
        /// The network's name.
        model: String,
    },
    /// Poses of a network for depth alone.
    #[error("`{model}` is a depth network alone: it has no pose network")]
    NoPoseNet {
        /// Its name.
        model: String,
    },
    /// An embedded network that is not the one a configuration began from.
    #[error(
        "the embedded network `{name}` is another one than this configuration began from: SHA-256 {found}, not {expected}"
    )]
    OtherStart {
        /// Its name.
        name: String,
        /// Of the weights in this build.
        found: String,
        /// In the configuration.
        expected: String,
    },
    /// A file where a run's folder is needed.
    #[error("{}: pictures need a run's folder, and this is a file", path.display())]
    NoModel {
        /// The file.
        path: PathBuf,
    },
    /// Several drives where one is needed.
    #[error("{}: holds {drives} drives, and a bag is one", input.display())]
    SeveralDrives {
        /// What was given.
        input: PathBuf,
        /// How many it holds.
        drives: usize,
    },
    /// A ROS 2 bag asked for.
    #[error("{}: bags of ROS 2 are read, not written", path.display())]
    NoRos2Writer {
        /// The output's name.
        path: PathBuf,
    },
    /// An exported file that is not the network.
    #[error(
        "{}: {engine} is {deviation:.1e} away from the network (max |difference| / max |value|), more than {:.0e}; not kept",
        path.display(),
        deepfusion_onnx::check::TOLERANCE
    )]
    Deviates {
        /// The file that would have been written.
        path: std::path::PathBuf,
        /// What ran it.
        engine: String,
        /// How far it is from the network.
        deviation: f64,
    },
    /// An engine for processors on another device.
    #[error("only `--engine burn` computes on other devices than the processor")]
    OnlyOnCpu,
    /// A library for another engine.
    #[error("`--ort-lib` is of use to `--engine ort` alone")]
    OnlyOrt,
    /// A precision that an engine does not have.
    #[error("`--precision bf16` is the fused engine's")]
    OnlyFused,
    /// An output that another run made, or this one of another image.
    #[error("{}: is there already, {why}", path.display())]
    Stale {
        /// The sidecar.
        path: PathBuf,
        /// In what it differs.
        why: String,
    },
    /// A shard of a job beside shards of another.
    #[error("{}: the shards of this folder were begun with {why}", path.display())]
    OtherJob {
        /// The other shard's manifest.
        path: PathBuf,
        /// In what it differs.
        why: String,
    },
    /// A recording that should not be trained on.
    #[error("{}: {errors} {} would make training fail or give a wrong scale", path.display(), if *errors == 1 { "error" } else { "errors" })]
    Unfit {
        /// The recording.
        path: PathBuf,
        /// How many errors were found.
        errors: usize,
    },
    /// Images that could not be predicted, while others could.
    #[error("{}", some_failed(failures, *total, *interrupted))]
    SomeFailed {
        /// What each of them failed for.
        failures: Vec<String>,
        /// How many images there were in all.
        total: usize,
        /// Whether the run was stopped before the others were done.
        interrupted: bool,
        /// The first remedy that one of the failures knows.
        hint: Option<String>,
    },
    /// A run that was stopped.
    #[error("stopped: {done} of {total} images are done")]
    Interrupted {
        /// Images done.
        done: usize,
        /// Images in all.
        total: usize,
    },
    /// Training that was stopped, and saved.
    #[error("stopped after {step} of {steps} steps; the run is saved")]
    Stopped {
        /// Steps done.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// The command that goes on with it.
        go_on: String,
    },
    /// An option that is not what a resumed run has.
    #[error("`{option}`: {asked} contradicts the run, which {run}")]
    Contradicts {
        /// The option.
        option: String,
        /// What it asks for.
        asked: String,
        /// What the run has or is, in words that follow on "which".
        run: String,
    },
    /// A recording of a resumed run that is not where it was.
    #[error("{}: no such file or folder, and {} learns from it", path.display(), run.display())]
    Moved {
        /// The recording.
        path: PathBuf,
        /// The run's folder.
        run: PathBuf,
        /// The option that says where it is now; none for a data set's.
        option: Option<&'static str>,
    },
    /// Work that was stopped and has nothing to go on with.
    #[error("{what} was stopped before it was done")]
    Ended {
        /// The work.
        what: &'static str,
    },
    /// A live source beside other inputs.
    #[error("{address}: a live source is looked at alone, without other inputs")]
    LiveAlone {
        /// The source.
        address: String,
    },
    /// Standard input asked for, and nobody pipes anything.
    #[error("standard input is a terminal: no stream is piped in")]
    Terminal,
    /// A part of a live source.
    #[error("a live source cannot be shared among shards: nothing is there to be counted yet")]
    LiveShard,
    /// An option of live sources for files.
    #[error("`{option}` is for live sources, and these inputs are files")]
    OnlyLive {
        /// The option.
        option: &'static str,
    },
    /// An option of the scale monitor where nothing can be watched.
    #[error("{input}: {why}, and `{option}` needs both speed and yaw rate")]
    Unwatched {
        /// The option.
        option: &'static str,
        /// The first input that cannot be watched.
        input: String,
        /// Why not.
        why: String,
    },
    /// A correction that follows the frames, of which this run sees a part.
    #[error("`--correct-scale` follows all frames of a recording, and a shard sees only some")]
    CorrectShard,
    /// A video of every other frame.
    #[error(
        "`--save video` shows the frames of a recording one after the other, and a shard sees only some"
    )]
    VideoShard,
    /// A cloud without a camera.
    #[error("a point cloud needs the camera's intrinsics, and the model knows none")]
    NoCamera,
    /// `--save sigma` of a network, or an engine, that does not say how sure it is.
    #[error("this network, or the engine that runs it, does not say how sure it is of its depth")]
    NoUncertainty,
}

impl CliError {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Exists { remedy, .. } => Some((*remedy).to_owned()),
            Self::NoBackend { device } => Some(format!(
                "build it with `cargo build --release --features {device}`, or use --device cpu"
            )),
            #[cfg(not(feature = "rerun"))]
            Self::NoRerun => Some(
                "build it with `cargo build --release --features rerun`, or leave out --rerun to look at the folder in a browser".into(),
            ),
            Self::NoImages { .. } => Some(
                "give images, a folder of them, or a pattern such as 'drive/*.png'; a recording is given by its own folder or file".into(),
            ),
            Self::NoModelGiven => Some(
                "train one (deepfusion train --data DRIVE), then give its folder: --model RUN".into(),
            ),
            Self::BuiltWithoutTraining { .. } => Some(
                "use a program built with the feature `train`, which is on by default".into(),
            ),
            Self::NoRunFolder { .. } => Some(
                "train on from it (deepfusion train --data DRIVE --init NAME), and give that run's folder".into(),
            ),
            Self::NoPoseNet { .. } => Some("give the folder of a run that `train` wrote".into()),
            Self::OtherStart { .. } => Some(
                "take the version of the program that made the run, or remove init_sha256 from the file to begin from this one".into(),
            ),
            Self::NoModel { .. } => Some("give run folders alone, or leave out --pictures".into()),
            Self::SeveralDrives { .. } => Some("convert them one by one: give a drive's own folder".into()),
            Self::NoRos2Writer { .. } => {
                Some("give a name that ends in .bag for a ROS 1 bag, or another folder for KITTI raw".into())
            }
            Self::Deviates { .. } => {
                Some("this is a fault of the program or of the library that ran the file; please report it".into())
            }
            Self::OnlyOnCpu => Some("leave out --engine, or give --device cpu".into()),
            Self::OnlyOrt => Some("add --engine ort, or leave out --ort-lib".into()),
            Self::OnlyFused => Some("give --engine fused --device cpu, or leave out --precision".into()),
            Self::Stale { .. } => Some(
                "--overwrite replaces what was made differently; or choose another folder".into(),
            ),
            Self::OtherJob { .. } => Some(
                "start every shard with the same inputs and options; --overwrite begins anew, or choose \
                 another folder"
                    .into(),
            ),
            Self::SomeFailed { hint, .. } => Some(match hint {
                Some(hint) => format!("{hint}; then run the same again: only what is missing is done"),
                None => "mend them and run the same again: only what is missing is done".into(),
            }),
            Self::Unfit { .. } => Some("each finding above has its remedy; --verbose tells every figure".into()),
            Self::Interrupted { .. } => {
                Some("run the same again: only what is missing is done".into())
            }
            Self::Stopped { go_on, .. } => Some(format!("go on with: {go_on}")),
            Self::Contradicts { .. } => {
                Some("leave it out to go on with the run, or start a new one in another folder".into())
            }
            Self::Moved { option: Some(option), .. } => Some(format!(
                "if it was moved, say where it is now: {option} PATH; if its disk is not mounted, mount it"
            )),
            Self::Moved { run, option: None, .. } => Some(format!(
                "if it was moved, correct its path in {}",
                run.join("config.toml").display()
            )),
            Self::Ended { .. } => Some("start it again, into another folder".into()),
            Self::LiveAlone { .. } => Some("start one run for each source, each with a folder of its own".into()),
            Self::Terminal => Some("… | deepfusion … -, or give a camera or an address instead of -".into()),
            Self::LiveShard => Some("leave --shard out".into()),
            Self::OnlyLive { .. } => {
                Some("leave it out, or give camera:0, an address such as rtsp://…, or - for standard input".into())
            }
            Self::Unwatched { .. } => Some("leave it out, or give recordings with speed and yaw rate alone".into()),
            Self::CorrectShard => Some("leave --shard out: give each run recordings of its own".into()),
            Self::VideoShard => {
                Some("save side-by-side in the shards, then run once more with --save video and without --shard".into())
            }
            Self::NoCamera => Some("give --intrinsics fx,fy,cx,cy or --calib".into()),
            Self::NoUncertainty => Some(
                "leave out sigma of --save and --max-sigma, or use a network trained with depth_net.uncertainty = true (not with --engine ort)"
                    .into(),
            ),
        }
    }
}

/// The failures of a run, a line each, as many as a person reads; the manifest has them all.
fn some_failed(failures: &[String], total: usize, interrupted: bool) -> String {
    const TOLD: usize = 20;
    let mut text = format!("{} of {total} images failed", failures.len());
    if interrupted {
        text += " before the run was stopped";
    }
    for failure in failures.iter().take(TOLD) {
        text += &format!("\n  {failure}");
    }
    if failures.len() > TOLD {
        let more = failures.len() - TOLD;
        text += &format!("\n  and {more} more, in the manifest");
    }
    text
}

/// A failure and its causes in one line.
pub fn told(problem: &anyhow::Error) -> String {
    let mut text = problem.to_string();
    for cause in problem.chain().skip(1).map(ToString::to_string) {
        // Many messages already hold their cause's.
        if !text.contains(&cause) {
            text += &format!(": {cause}");
        }
    }
    text
}

/// Prints a failure on stderr; the exit code is 1, [`interrupt::EXIT_CODE`] for work that was asked to stop, or 2 for a missing argument.
pub fn report(problem: &anyhow::Error) -> ExitCode {
    const ERROR: Style = AnsiColor::Red.on_default().bold();
    const HINT: Style = AnsiColor::Cyan.on_default().bold();
    let mut told = problem.to_string();
    let mut text = format!("{ERROR}error:{ERROR:#} {told}\n");
    for cause in problem.chain().skip(1) {
        let cause = cause.to_string();
        // Many messages already hold their cause's.
        if !told.contains(&cause) {
            text += &format!("  because: {cause}\n");
            told = cause;
        }
    }
    let hint = hint_of(problem).unwrap_or_else(|| general_hint(problem));
    text += &format!("{HINT}hint:{HINT:#} {hint}\n");
    // Where nobody reads it any more, the code still tells.
    let _ = anstream::stderr().write_all(text.as_bytes());
    if was_stopped(problem) {
        ExitCode::from(interrupt::EXIT_CODE)
    } else if lacks_an_argument(problem) {
        ExitCode::from(WRONG_ARGUMENTS)
    } else {
        ExitCode::FAILURE
    }
}

/// The exit code of wrong arguments, clap's.
const WRONG_ARGUMENTS: u8 = 2;

/// Whether an argument is missing that clap could not miss: whether it is needed depends on what is embedded.
fn lacks_an_argument(problem: &anyhow::Error) -> bool {
    matches!(problem.downcast_ref(), Some(CliError::NoModelGiven))
}

/// Whether nothing failed, but the work was asked to stop.
fn was_stopped(problem: &anyhow::Error) -> bool {
    problem.chain().any(|cause| {
        let ours = matches!(
            cause.downcast_ref(),
            Some(CliError::Interrupted { .. } | CliError::Stopped { .. } | CliError::Ended { .. })
        );
        // Compiled in or not, the error is the same type.
        let viewers = matches!(
            cause.downcast_ref(),
            Some(deepfusion_view::Error::Stopped { .. })
        );
        ours || viewers
    })
}

/// What to do about an error that knows no remedy of its own: the system's reason decides.
fn general_hint(problem: &anyhow::Error) -> String {
    use std::io::ErrorKind;
    let kind = problem.chain().find_map(|cause| {
        let error = cause.downcast_ref::<std::io::Error>();
        error.map(std::io::Error::kind)
    });
    match kind {
        Some(ErrorKind::NotFound) => "check the spelling, and that the disk is mounted",
        Some(ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem) => {
            "check the permissions, or choose a place that you may write to"
        }
        Some(ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {
            "the disk is full: free some space and run the same again"
        }
        Some(_) => "the system gave this reason: look at the disk or the network that the file is on",
        None => {
            "where the message names no input of yours to mend, it is a fault of the program: please report it with the command"
        }
    }
    .to_owned()
}

/// The first remedy that an error of the chain knows.
pub fn hint_of(problem: &anyhow::Error) -> Option<String> {
    problem.chain().find_map(|cause| {
        macro_rules! hint_from {
            ($($error:ty),* $(,)?) => {
                $(if let Some(error) = cause.downcast_ref::<$error>() { return error.hint(); })*
            };
        }
        hint_from!(
            CliError,
            deepfusion_geometry::cloud::Error,
            deepfusion_compare::Error,
            deepfusion_data::Error,
            deepfusion_eval::Error,
            deepfusion_instances::Error,
            deepfusion_eval::odometry::PoseFileError,
            deepfusion_eval::odometry::TrackError,
            deepfusion_model::Error,
            deepfusion_model::NetworkError,
            deepfusion_runtime::Error,
            deepfusion_onnx::Error,
            deepfusion_perception::Error,
            deepfusion_render::Error,
            deepfusion_sim::Error,
            deepfusion_view::Error,
            deepfusion_weights::Error,
        );
        #[cfg(feature = "train")]
        hint_from!(deepfusion_train::Error);
        cause.downcast_ref().and_then(jobs::hint)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error as IoError, ErrorKind};

    /// No error leaves its reader without a next step, whatever kind it is.
    #[test]
    fn every_error_has_a_hint() {
        let full = anyhow::Error::new(IoError::from(ErrorKind::StorageFull)).context("log.csv");
        assert!(general_hint(&full).contains("disk is full"));
        let foreign = anyhow::anyhow!("a library's own words");
        assert_eq!(hint_of(&foreign), None);
        assert!(general_hint(&foreign).contains("report"));
        let config = deepfusion_model::Error::Config {
            field: "batch",
            expected: "at least 1".into(),
            found: "0".into(),
        };
        assert!(hint_of(&config.into()).unwrap().contains("batch"));
        let images = CliError::NoImages { input: "x".into() };
        assert!(hint_of(&images.into()).is_some());
    }

    /// `train && eval` and a scheduler tell by the code alone.
    #[test]
    fn what_was_stopped_is_neither_done_nor_failed() {
        let go_on = String::new();
        let (step, steps) = (3, 9);
        let stopped = [
            CliError::Stopped { step, steps, go_on },
            CliError::Ended { what: "the demo" },
            CliError::Interrupted { done: 1, total: 2 },
        ];
        for error in stopped {
            assert!(was_stopped(&error.into()));
        }
        let path = PathBuf::from("a.rrd");
        let (done, total) = (1, 2);
        let view = deepfusion_view::Error::Stopped { path, done, total };
        assert!(was_stopped(&anyhow::Error::new(view).context("view")));
        assert!(!was_stopped(&CliError::NoCamera.into()));
    }
}
