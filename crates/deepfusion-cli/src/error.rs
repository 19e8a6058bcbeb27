//! The failures that only the command line knows.

use std::collections::HashMap;
use std::path::PathBuf;

use deepfusion_hint::count_of;
use deepfusion_sim::VariedConflict;

use crate::failure::{Exit, Reportable};

/// Failures that only the command line knows.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// Something that would be overwritten.
    #[error("{}: already exists", path.display())]
    Exists {
        /// The file or folder.
        path: PathBuf,
        /// The option that allows it, or what else to do.
        hint: &'static str,
    },
    /// A device that computes something else than the processor.
    #[cfg(feature = "train")]
    #[error(
        "{wrong} of {} on `{device}` {} not what the processor computes",
        count_of(*of, "operation"),
        if *wrong == 1 { "is" } else { "are" }
    )]
    DeviceDiffers {
        /// The device.
        device: String,
        /// How many operations differ or failed.
        wrong: usize,
        /// Of how many.
        of: usize,
        /// What to do without.
        hint: String,
    },
    /// A file of a viewer that was not compiled in.
    #[cfg(not(feature = "rerun"))]
    #[error("this build writes no files for the rerun viewer")]
    NoRerun,
    /// A text that cannot be a moment on a log's clock.
    #[error("--start {word}: not a moment on the log's clock")]
    NotOnClock {
        /// What was given.
        word: String,
    },
    /// An option of `doctor` that says nothing of what is looked at.
    #[error("{}: {option} does not apply to {}", path.display(), if *is_log { "a log of speeds by itself" } else { "a recording" })]
    OutOfPlace {
        /// What is looked at.
        path: PathBuf,
        /// The option.
        option: &'static str,
        /// Whether it is a log of speeds by itself.
        is_log: bool,
    },
    /// An option that says nothing of the layout to be written.
    #[error("{option} is not for this layout: {why}")]
    OtherLayout {
        /// The option.
        option: &'static str,
        /// Why not.
        why: &'static str,
        /// The layout that it is for.
        layout: &'static str,
    },
    /// What a varied drive, or one that is not, cannot have.
    #[error("{given}: {why}")]
    Varied {
        /// The option, as it was given.
        given: String,
        /// Why not.
        why: VariedConflict,
    },
    /// A log without anything that saw the drive.
    #[error("neither a video nor images are given for the log")]
    NoMedia,
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
    /// A file where a run's folder is needed.
    #[error("{}: pictures need a run's folder, and this is a file", path.display())]
    NoModel {
        /// The file.
        path: PathBuf,
    },
    /// Several drives where one is needed.
    #[error("{}: holds {drives} drives, and a bag holds one", input.display())]
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
    /// Several recordings, of which some cannot be read, or all for different reasons.
    #[error("{}: {unreadable} of {} cannot be read", path.display(), count_of(*recordings, "recording"))]
    Unreadable {
        /// What was given.
        path: PathBuf,
        /// How many of them cannot.
        unreadable: usize,
        /// How many there are.
        recordings: usize,
        /// What to do about the first.
        hint: Option<String>,
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
        /// Whether the same command goes on with what is missing.
        resumes: bool,
        /// The first hint that one of the failures has.
        hint: Option<String>,
    },
    /// Nothing but what was written there before.
    #[error("{input}: no image but outputs of this program")]
    OutputsAlone {
        /// What was given.
        input: String,
    },
    /// Tables that would be written into the file of the pictures beside them.
    #[error("{}: the file of the pictures beside the tables, which are asked for under the same name", path.display())]
    TablesInPicture {
        /// The file.
        path: PathBuf,
    },
    /// Outputs were to go into a file.
    #[error("{}: a file, and a folder is to be written there", path.display())]
    NotAFolder {
        /// The file.
        path: PathBuf,
    },
    /// A run that was stopped.
    #[error("stopped: {done} of {} {} done", count_of(*total, "image"), if *done == 1 || *total == 1 { "is" } else { "are" })]
    Interrupted {
        /// Images done.
        done: usize,
        /// Images in all.
        total: usize,
        /// Whether the same command goes on with what is missing.
        resumes: bool,
    },
    /// Training that was stopped, and saved.
    #[error("stopped after {step} of {}; the run is saved", count_of(*steps, "step"))]
    Stopped {
        /// Steps done.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// The command that goes on with it.
        go_on: String,
    },
    /// A recording of a resumed run that is not where it was.
    #[error("{}: no such file or folder, and {} learns from it", path.display(), run.display())]
    Moved {
        /// The recording.
        path: PathBuf,
        /// The run's folder.
        run: PathBuf,
        /// The option that says where it is now; none for a data set's.
        option: Option<String>,
    },
    /// An adapted network that is worse than the one it began from.
    #[cfg(feature = "train")]
    #[error("not kept: on the frames that are held out it became worse: {worse}; moved to {}", path.display())]
    Refused {
        /// Where it lies.
        path: PathBuf,
        /// In what.
        worse: String,
    },
    /// An adapted network that cannot be compared with the one it began from.
    #[cfg(feature = "train")]
    #[error("not kept: {}; moved to {}", deepfusion_jobs::training::adaptation::Refusal::NotJudged, path.display())]
    NothingJudged {
        /// Where it lies.
        path: PathBuf,
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
    #[error("a live source cannot be split into shards: its number of frames is not known")]
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
}

impl Reportable for CliError {
    fn exit(&self) -> Exit {
        match self {
            Self::Interrupted { .. } | Self::Stopped { .. } | Self::Ended { .. } => Exit::Stopped,
            // Clap could not see it: what is needed depends on what is embedded, what applies on what lies at the path.
            Self::NoModelGiven
            | Self::OutOfPlace { .. }
            | Self::OtherLayout { .. }
            | Self::Varied { .. } => Exit::WrongArguments,
            _ => Exit::Failed,
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Exists { hint, .. } => Some((*hint).to_owned()),
            #[cfg(feature = "train")]
            Self::DeviceDiffers { hint, .. } => Some(hint.clone()),
            #[cfg(not(feature = "rerun"))]
            Self::NoRerun => Some(
                "build it with `cargo build --release --features rerun`, or leave out --rerun to look at the folder in a browser".into(),
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
            Self::NoModel { .. } => Some("give run folders alone, or leave out --pictures".into()),
            Self::SeveralDrives { .. } => Some("convert them one by one: give a drive's own folder".into()),
            Self::NoRos2Writer { .. } => {
                Some("give a name that ends in .bag for a ROS 1 bag, or another folder for KITTI raw".into())
            }
            Self::SomeFailed { hint, resumes, .. } => Some(match hint {
                Some(hint) => format!("{hint}; then {}", again(*resumes)),
                None => format!("mend them, then {}", again(*resumes)),
            }),
            Self::Unfit { .. } => Some("each finding above has its hint; --verbose prints every figure".into()),
            Self::Unreadable { unreadable, recordings, hint, .. } => Some(format!(
                "each is listed with its reason; {}{}",
                hint.as_deref().unwrap_or("mend them"),
                if unreadable < recordings { ", or give the others by themselves" } else { "" }
            )),
            Self::OutputsAlone { .. } => Some("give the images that they were made of".into()),
            Self::TablesInPicture { .. } => Some("give --out another ending, as .html or .txt".into()),
            Self::NotAFolder { .. } => Some("give --out a folder, which is made where it is not there".into()),
            Self::Interrupted { resumes, .. } => Some(again(*resumes).to_owned()),
            Self::Stopped { go_on, .. } => Some(format!("go on with: {go_on}")),
            Self::Moved { option: Some(option), .. } => Some(format!(
                "if it was moved, say where it is now: {option} PATH; if its disk is not mounted, mount it"
            )),
            Self::Moved { run, option: None, .. } => Some(format!(
                "if it was moved, correct its path in {}",
                run.join("config.toml").display()
            )),
            #[cfg(feature = "train")]
            Self::Refused { .. } => Some(
                "the given network is the better one here; more drives, fewer --steps or a smaller --learning-rate may change that".into(),
            ),
            #[cfg(feature = "train")]
            Self::NothingJudged { .. } => Some(
                "give longer drives with a speed, or more of them with --held-out SHARE; fewer --steps or a smaller --learning-rate change less".into(),
            ),
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
            Self::NotOnClock { .. } => Some("give seconds, a time of day or a date, as the log has them".into()),
            Self::OutOfPlace { is_log: true, .. } => Some(
                "leave it out; a log by itself takes --time, --speed, --unit and --dbc, and becomes a recording by deepfusion data import".into(),
            ),
            Self::OutOfPlace { .. } => Some(
                "leave it out; the columns of a recording's own log stand in its dataset.toml (time_column, speed_column, speed_unit, dbc)".into(),
            ),
            Self::OtherLayout { layout, .. } => Some(format!("leave it out, or give --format {layout}")),
            Self::Varied { why, .. } => Some(
                match why {
                    VariedConflict::CameraHeight => "leave out --camera-height or --varied",
                    VariedConflict::SecondCamera => "leave out --stereo or --varied",
                    VariedConflict::OnlyVaried => "add --varied, or choose another --scene",
                    _ => "choose another --scene",
                }
                .into(),
            ),
            Self::NoMedia => Some("give --video FILE or --images DIR".into()),
        }
    }
}

/// The failures of a run, a line each, as many as a person reads; the manifest has them all.
fn some_failed(failures: &[String], total: usize, interrupted: bool) -> String {
    const SHOWN: usize = 20;
    let mut text = format!("{} of {} failed", failures.len(), count_of(total, "image"));
    if interrupted {
        text += " before the run was stopped";
    }
    let different = counted(failures);
    for (failure, images) in different.iter().take(SHOWN) {
        text += &match images {
            1 => format!("\n  {failure}"),
            n => format!("\n  {failure} ({n} times)"),
        };
    }
    let more: usize = different.iter().skip(SHOWN).map(|(_, images)| images).sum();
    if more > 0 {
        text += &format!("\n  and {more} more, in the manifest");
    }
    text
}

/// Different texts in their order, each with how often it is there: what is wrong with a video is so for each of its frames.
fn counted(texts: &[String]) -> Vec<(&str, usize)> {
    let mut different = Vec::new();
    let mut places = HashMap::new();
    for text in texts {
        let place = *places.entry(text.as_str()).or_insert(different.len());
        if place == different.len() {
            different.push((text.as_str(), 0));
        }
        different[place].1 += 1;
    }
    different
}

/// How a bulk run is gone on with.
fn again(resumes: bool) -> &'static str {
    if resumes {
        "run the same again: finished images are kept"
    } else {
        "run it anew with --overwrite: targets are followed from the first image on"
    }
}

#[cfg(test)]
mod tests {
    use super::CliError;

    #[test]
    fn what_many_images_failed_for_is_said_once() {
        let failures: Vec<String> = ["a.mp4.frames: refused", "b.png: no image"]
            .into_iter()
            .chain(["a.mp4.frames: refused"; 30])
            .map(str::to_owned)
            .collect();
        let said = super::some_failed(&failures, 40, false);
        let expected =
            "32 of 40 images failed\n  a.mp4.frames: refused (31 times)\n  b.png: no image";
        assert_eq!(said, expected);
        let different: Vec<String> = (0..22).map(|i| format!("{i}.png: no image")).collect();
        let said = super::some_failed(&different, 40, false);
        assert!(said.ends_with("and 2 more, in the manifest"), "{said}");
    }

    #[test]
    fn one_image_is_no_plural() {
        let said = |done, total| {
            let resumes = true;
            let stopped = CliError::Interrupted {
                done,
                total,
                resumes,
            };
            stopped.to_string()
        };
        assert_eq!(said(0, 1), "stopped: 0 of 1 image is done");
        assert_eq!(said(1, 5), "stopped: 1 of 5 images is done");
        assert_eq!(said(2, 5), "stopped: 2 of 5 images are done");
    }

    #[cfg(feature = "train")]
    #[test]
    fn what_cannot_be_judged_is_not_called_worse() {
        let path = "mine.refused".into();
        assert_eq!(
            CliError::NothingJudged { path }.to_string(),
            "not kept: the held-out frames can no longer be used to judge it; moved to mine.refused"
        );
    }
}
