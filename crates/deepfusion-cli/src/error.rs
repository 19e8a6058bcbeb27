//! The errors that only the command line raises.

use std::collections::HashMap;
use std::path::PathBuf;

use deepfusion_data::NamedTopic;
use deepfusion_hint::count_of;
use deepfusion_sim::VariedConflict;

use crate::failure::{Exit, Reportable};

/// Errors that only the command line raises.
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
    /// A device whose results differ from the processor's.
    #[cfg(feature = "train")]
    #[error(
        "{wrong} of {} on `{device}` {} the processor's results",
        count_of(*of, "operation"),
        if *wrong == 1 { "does not match" } else { "do not match" }
    )]
    DeviceDiffers {
        /// The device.
        device: String,
        /// How many operations differ or failed.
        wrong: usize,
        /// How many operations were compared.
        of: usize,
        /// What to do instead.
        hint: String,
    },
    /// A file for the rerun viewer, in a build without it.
    #[cfg(not(feature = "rerun"))]
    #[error("this build writes no files for the rerun viewer")]
    NoRerun,
    /// A table whose rows cannot be measured.
    #[cfg(feature = "train")]
    #[error("no frame to measure the rows on has ground truth")]
    NoTruth,
    /// A term to be both switched on and left out.
    #[cfg(feature = "train")]
    #[error("--with {term} and --without {term} contradict each other")]
    OnAndOff {
        /// The term.
        term: String,
    },
    /// A text that is not a time on the log's clock.
    #[error("--start {word}: not a time on the log's clock")]
    NotOnClock {
        /// What was given.
        word: String,
    },
    /// An option of `doctor` that does not apply to its input.
    #[error("{}: {option} does not apply to {}", path.display(), if *is_log { "a log of speeds by itself" } else { "a recording" })]
    OutOfPlace {
        /// The input.
        path: PathBuf,
        /// The option.
        option: &'static str,
        /// Whether the input is a log of speeds by itself.
        is_log: bool,
    },
    /// A DBC file for a log without CAN frames.
    #[error("{}: --dbc does not apply to it: it is not a CAN trace", path.display())]
    NotACanTrace {
        /// The log.
        path: PathBuf,
    },
    /// An option that does not apply to the layout to be written.
    #[error("{option} does not apply to this layout: {why}")]
    OtherLayout {
        /// The option.
        option: &'static str,
        /// Why not.
        why: &'static str,
        /// The layout that it applies to.
        layout: &'static str,
    },
    /// An option of `simulate` that a varied drive, or any other one, cannot have.
    #[error("{given}: {why}")]
    Varied {
        /// The option, as it was given.
        given: String,
        /// Why not.
        why: VariedConflict,
    },
    /// A log to import without images of the drive.
    #[error("no video and no images are given for the log")]
    NoMedia,
    /// No network named, and none embedded.
    #[error("no `--model` is given, and this build has no embedded network to use instead")]
    NoModelGiven,
    /// Something that only the training framework can do, in a build without it.
    #[cfg_attr(
        feature = "train",
        allow(dead_code, reason = "builds with training can do it")
    )]
    #[error("{what} needs the training framework, which this build leaves out")]
    BuiltWithoutTraining {
        /// The command or option.
        what: &'static str,
    },
    /// An option that writes into a run's folder, for a network without one.
    #[error("{option}: `{model}` has no run folder to write to")]
    NoRunFolder {
        /// The option.
        option: &'static str,
        /// The network's name.
        model: String,
    },
    /// Poses asked of a network that predicts only depth.
    #[error("`{model}` predicts only depth: it has no pose network")]
    NoPoseNet {
        /// The network's name.
        model: String,
    },
    /// A file where a run's folder is needed.
    #[error("{}: a file, expected a run's folder for the pictures", path.display())]
    NoModel {
        /// The file.
        path: PathBuf,
    },
    /// Several drives where one is needed.
    #[error("{}: contains {drives} drives, but a bag can have only one", input.display())]
    SeveralDrives {
        /// What was given.
        input: PathBuf,
        /// How many drives it contains.
        drives: usize,
    },
    /// A ROS 2 bag asked for.
    #[error("{}: ROS 2 bags can be read, but not written", path.display())]
    NoRos2Writer {
        /// The output's name.
        path: PathBuf,
    },
    /// Several recordings, of which some cannot be read, or all for different reasons.
    #[error("{}: {unreadable} of {} cannot be read", path.display(), count_of(*recordings, "recording"))]
    Unreadable {
        /// What was given.
        path: PathBuf,
        /// How many of the recordings cannot be read.
        unreadable: usize,
        /// How many recordings there are.
        recordings: usize,
        /// What to do about the first that cannot be read.
        hint: Option<String>,
    },
    /// A recording that should not be trained on.
    #[error("{}: {} would make training fail or give a wrong scale", path.display(), count_of(*errors, "error"))]
    Unfit {
        /// The recording.
        path: PathBuf,
        /// How many errors were found.
        errors: usize,
    },
    /// Images that could not be predicted, while others could.
    #[error("{}", some_failed(failures, *total, *interrupted))]
    SomeFailed {
        /// Why each image failed.
        failures: Vec<String>,
        /// How many images there were in all.
        total: usize,
        /// Whether the run was stopped before the others were done.
        interrupted: bool,
        /// Whether the same command continues with the missing images.
        resumes: bool,
        /// The first hint among the failures.
        hint: Option<String>,
    },
    /// A folder whose only images were written by this program.
    #[error("{input}: no images, only outputs of this program")]
    OutputsAlone {
        /// What was given.
        input: String,
    },
    /// Tables that would overwrite the pictures beside them.
    #[error("{}: the tables and the pictures would be written to this same file", path.display())]
    TablesInPicture {
        /// The file.
        path: PathBuf,
    },
    /// A file where the folder for the outputs should be.
    #[error("{}: a file, expected a folder for the outputs", path.display())]
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
        /// Whether the same command continues with the missing images.
        resumes: bool,
    },
    /// Training that was stopped, and saved.
    #[error("stopped after {step} of {}; the run is saved", count_of(*steps, "step"))]
    Stopped {
        /// Steps done.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// The command that continues the run.
        go_on: String,
    },
    /// A recording of a resumed run that is no longer where it was.
    #[error("{}: no such file or folder, but {} trains on it", path.display(), run.display())]
    Moved {
        /// The recording.
        path: PathBuf,
        /// The run's folder.
        run: PathBuf,
        /// The option that gives its new path; none for a recording of `[[data.sets]]`.
        option: Option<String>,
    },
    /// An adapted network that is worse than the one it started from.
    #[cfg(feature = "train")]
    #[error("not kept: worse on the held-out frames ({worse}); moved to {}", path.display())]
    Refused {
        /// The folder it was moved to.
        path: PathBuf,
        /// Which metrics became worse.
        worse: String,
    },
    /// An adapted network that cannot be compared with the one it started from.
    #[cfg(feature = "train")]
    #[error("not kept: {}; moved to {}", deepfusion_jobs::training::adaptation::Refusal::NotJudged, path.display())]
    NothingJudged {
        /// The folder it was moved to.
        path: PathBuf,
    },
    /// Work that was stopped and cannot be continued.
    #[error("{what} was stopped before it was finished")]
    Ended {
        /// The work.
        what: &'static str,
    },
    /// A live source beside other inputs.
    #[error("{address}: a live source cannot be combined with other inputs")]
    LiveAlone {
        /// The source.
        address: String,
    },
    /// Standard input asked for, while it is a terminal.
    #[error("standard input is a terminal: no stream is piped in")]
    Terminal,
    /// A shard of a live source.
    #[error("a live source cannot be split into shards: its number of frames is not known")]
    LiveShard,
    /// An option of live sources for files.
    #[error("`{option}` is for live sources, but these inputs are files")]
    OnlyLive {
        /// The option.
        option: &'static str,
    },
    /// A topic for inputs without topics.
    #[error("{input}: not a bag, so it has no topics for `--topic {topic}`")]
    NoTopics {
        /// What was given.
        input: String,
        /// The topic.
        topic: NamedTopic,
    },
    /// An option of the scale monitor for an input that lacks speed or yaw rate.
    #[error("{input}: {why}, but `{option}` needs both speed and yaw rate")]
    Unwatched {
        /// The option.
        option: &'static str,
        /// The first input that cannot be monitored.
        input: String,
        /// Why not.
        why: String,
    },
    /// A correction that needs all frames of a recording, in a shard.
    #[error("`--correct-scale` needs all frames of a recording, but a shard has only some")]
    CorrectShard,
    /// A video of all frames of a recording, in a shard.
    #[error("`--save video` needs all frames of a recording, but a shard has only some")]
    VideoShard,
}

impl Reportable for CliError {
    fn exit(&self) -> Exit {
        match self {
            Self::Interrupted { .. } | Self::Stopped { .. } | Self::Ended { .. } => Exit::Stopped,
            // Clap cannot check these: they depend on the embedded networks and on the contents of the given path.
            Self::NoModelGiven
            | Self::OutOfPlace { .. }
            | Self::NotACanTrace { .. }
            | Self::OtherLayout { .. }
            | Self::Varied { .. } => Exit::WrongArguments,
            #[cfg(feature = "train")]
            Self::OnAndOff { .. } => Exit::WrongArguments,
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
                "build deepfusion with `cargo build --release --features rerun`, or leave out --rerun to look at the folder in a browser".into(),
            ),
            Self::NoModelGiven => Some(
                "train a network (deepfusion train --data DRIVE), then give its folder: --model RUN".into(),
            ),
            Self::BuiltWithoutTraining { .. } => Some(
                "use a program built with the feature `train`, which is on by default".into(),
            ),
            Self::NoRunFolder { .. } => Some(
                "train from it first (deepfusion train --data DRIVE --init NAME), then give that run's folder".into(),
            ),
            Self::NoPoseNet { .. } => Some("give the folder of a run that `train` wrote".into()),
            Self::NoModel { .. } => Some("give only run folders, or leave out --pictures".into()),
            Self::SeveralDrives { .. } => Some("convert them one by one: give the folder of one drive".into()),
            Self::NoRos2Writer { .. } => {
                Some("give a name that ends in .bag for a ROS 1 bag, or another folder for KITTI raw".into())
            }
            Self::SomeFailed { hint, resumes, .. } => Some(match hint {
                Some(hint) => format!("{hint}; then {}", how_to_continue(*resumes)),
                None => format!("fix them, then {}", how_to_continue(*resumes)),
            }),
            Self::Unfit { .. } => Some("follow the hints above; --verbose prints every measurement".into()),
            Self::Unreadable { unreadable, recordings, hint, .. } => Some(format!(
                "each is listed with its reason; {}{}",
                hint.as_deref().unwrap_or("fix them"),
                if unreadable < recordings { ", or give only the others" } else { "" }
            )),
            Self::OutputsAlone { .. } => Some("give the images that they were made from".into()),
            Self::TablesInPicture { .. } => Some("give --out another ending, such as .html or .txt".into()),
            Self::NotAFolder { .. } => Some("give --out a folder; it is created if it does not exist".into()),
            Self::Interrupted { resumes, .. } => Some(how_to_continue(*resumes).to_owned()),
            Self::Stopped { go_on, .. } => Some(format!("continue with: {go_on}")),
            Self::Moved { option: Some(option), .. } => Some(format!(
                "if it was moved, give its new path: {option} PATH; if its disk is not mounted, mount it"
            )),
            Self::Moved { run, option: None, .. } => Some(format!(
                "if it was moved, correct its path in {}",
                run.join("config.toml").display()
            )),
            #[cfg(feature = "train")]
            Self::Refused { .. } => Some(
                "keep using the given network, or try more drives, fewer --steps or a smaller --learning-rate".into(),
            ),
            #[cfg(feature = "train")]
            Self::NothingJudged { .. } => Some(
                "give longer drives with a speed, hold out more with --held-out SHARE, or change the network less with fewer --steps or a smaller \
                 --learning-rate"
                    .into(),
            ),
            Self::Ended { .. } => Some("start again, with another folder".into()),
            Self::LiveAlone { .. } => Some("start one run for each source, each with its own folder".into()),
            Self::Terminal => Some("pipe a stream in (… | deepfusion … -), or give a camera or an address instead of -".into()),
            Self::LiveShard => Some("leave out --shard".into()),
            Self::OnlyLive { .. } => {
                Some("leave it out, or give camera:0, an address such as rtsp://…, or - for standard input".into())
            }
            Self::NoTopics { .. } => Some("leave out --topic, or give a bag".into()),
            Self::Unwatched { .. } => Some("leave it out, or give only recordings with speed and yaw rate".into()),
            Self::CorrectShard => Some("leave out --shard, and give each run its own recordings".into()),
            Self::VideoShard => {
                Some("save side-by-side in the shards, then run once more with --save video and without --shard".into())
            }
            #[cfg(feature = "train")]
            Self::OnAndOff { .. } => Some("keep one of them".into()),
            #[cfg(feature = "train")]
            Self::NoTruth => Some("give drives with scans or depth images: --eval-data PATH".into()),
            Self::NotOnClock { .. } => Some("give seconds, a time of day or a date, as in the log".into()),
            Self::OutOfPlace { is_log: true, .. } => Some(
                "leave it out: a log by itself takes --time, --speed, --unit and --dbc, and deepfusion data import makes a recording of it".into(),
            ),
            Self::OutOfPlace { .. } => Some(
                "leave it out: a recording's dataset.toml describes its log (time_column, speed_column, speed_unit, dbc)".into(),
            ),
            Self::NotACanTrace { .. } => Some(
                "leave it out, or give a CAN trace: candump's log, .asc or .blf".into(),
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

/// The failures of a run, one per line, up to a readable number; the manifest has them all.
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

/// The distinct texts in order of appearance, each with its count: a fault of a video is reported once for each of its frames.
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

/// How to continue a bulk run.
fn how_to_continue(resumes: bool) -> &'static str {
    if resumes {
        "run the same command again: finished images are kept"
    } else {
        "run it again with --overwrite: targets are tracked from the first image on"
    }
}

#[cfg(test)]
mod tests {
    use super::CliError;

    #[test]
    fn a_reason_shared_by_many_images_is_printed_once() {
        let failures: Vec<String> = ["a.mp4.frames: refused", "b.png: no image"]
            .into_iter()
            .chain(["a.mp4.frames: refused"; 30])
            .map(str::to_owned)
            .collect();
        let text = super::some_failed(&failures, 40, false);
        let expected =
            "32 of 40 images failed\n  a.mp4.frames: refused (31 times)\n  b.png: no image";
        assert_eq!(text, expected);
        let different: Vec<String> = (0..22).map(|i| format!("{i}.png: no image")).collect();
        let text = super::some_failed(&different, 40, false);
        assert!(text.ends_with("and 2 more, in the manifest"), "{text}");
    }

    #[test]
    fn one_image_is_singular() {
        let message = |done, total| {
            let resumes = true;
            let stopped = CliError::Interrupted {
                done,
                total,
                resumes,
            };
            stopped.to_string()
        };
        assert_eq!(message(0, 1), "stopped: 0 of 1 image is done");
        assert_eq!(message(1, 5), "stopped: 1 of 5 images is done");
        assert_eq!(message(2, 5), "stopped: 2 of 5 images are done");
    }

    #[cfg(feature = "train")]
    #[test]
    fn a_network_that_cannot_be_judged_is_not_called_worse() {
        let path = "mine.refused".into();
        assert_eq!(
            CliError::NothingJudged { path }.to_string(),
            "not kept: the held-out frames can no longer be used to judge it; moved to mine.refused"
        );
    }
}
