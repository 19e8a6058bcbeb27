//! What the library says of work over recordings and folders, in the command line's words.

use std::path::Path;

use deepfusion_hint::Hint;
use deepfusion_jobs::{Error, OtherJob, StaleReason};
use deepfusion_records::Difference;

use crate::error::CliError;
use crate::failure::{Exit, Failure, Reportable};

/// An error whose message speaks of options here.
pub(crate) fn in_words(error: Error) -> Failure {
    let made_with = |what| options_of(what).to_owned();
    match error {
        Error::Stale {
            path,
            why: StaleReason::MadeWith(what),
        } => {
            let why = format!("made with {}", made_with(what));
            CliError::Stale { path, why }.into()
        }
        Error::OtherJob {
            path,
            why: OtherJob::MadeWith(what),
        } => {
            let why = made_with(what);
            CliError::OtherJob { path, why }.into()
        }
        other => other.into(),
    }
}

impl Reportable for Error {
    fn message(&self) -> String {
        wrapped(self).map_or_else(|| self.to_string(), Reportable::message)
    }

    /// With the options that do it.
    fn remedy(&self) -> Option<String> {
        if let Some(error) = wrapped(self) {
            return error.remedy();
        }
        match self {
            Self::Exists { .. } => {
                Some("allow it with --overwrite, or choose another folder".into())
            }
            Self::LiveFrameExists { .. } => Some(
                "replace all of its live frames with --overwrite, or choose another folder".into(),
            ),
            Self::Stale { .. } => Some(
                "--overwrite replaces what was made differently; or choose another folder".into(),
            ),
            Self::OtherJob { .. } => Some(
                "start every shard with the same inputs and options; --overwrite begins anew, or choose another folder".into(),
            ),
            Self::Busy { .. } => {
                Some("wait for it, or share the work with --shard I/N, a different I each".into())
            }
            Self::Incomplete { .. } => Some(
                "give the folder that holds every drive that the split names, or leave --strict out to use what is there".into(),
            ),
            Self::CameraOf { source, .. } => source.remedy(),
            Self::NoCamera => Some("give --intrinsics fx,fy,cx,cy or --calib".into()),
            Self::NoUncertainty => Some(
                "leave out sigma and confidence of --save, and --max-sigma, or use a network trained with depth_net.uncertainty = true (not with --engine ort)"
                    .into(),
            ),
            Self::NothingToPack { .. } => {
                Some("train from it first: deepfusion train --data DRIVE --init RUN".into())
            }
            Self::SawReal { .. } => Some("leave --simulated-only out".into()),
            #[cfg(feature = "train")]
            Self::NotJudged { .. } => Some(
                "give longer drives with a speed, or more of them with --held-out SHARE; or learn without this check: deepfusion train --data DRIVE --init NETWORK".into(),
            ),
            #[cfg(feature = "train")]
            Self::NotAdapted { .. } => Some("give the folder that `adapt --out` named".into()),
            other => other.hint(),
        }
    }

    fn exit(&self) -> Exit {
        wrapped(self).map_or(Exit::Failed, Reportable::exit)
    }

    fn missing(&self) -> Option<&Path> {
        wrapped(self)?.missing()
    }
}

/// The error of another library that this one only passes on: it is reported as that library's.
fn wrapped(error: &Error) -> Option<&dyn Reportable> {
    match error {
        Error::Video(error) => Some(error),
        Error::Data(error) => Some(error),
        Error::Cloud(error) => Some(error),
        Error::PoseFile(error) => Some(error),
        Error::Track(error) => Some(error),
        Error::Calibrate(error) => Some(error),
        Error::Eval(error) => Some(error),
        Error::Compare(error) => Some(error),
        Error::Model(error) => Some(error),
        Error::Weights(error) => Some(error),
        Error::Simulator(error) => Some(error),
        Error::Runtime(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Onnx(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Network(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Train(error) => Some(error),
        Error::Render(error) => Some(error),
        Error::Instances(error) => Some(error),
        Error::Perception(error) => Some(error),
        _ => None,
    }
}

/// What differs, with its options.
fn options_of(what: Difference) -> &'static str {
    match what {
        Difference::Version => "another program version",
        Difference::Weights => "other weights (--model)",
        Difference::Engine => "another engine (--engine, --precision)",
        Difference::Save => "another --save",
        Difference::Set => "another --data-set",
        Difference::MaxDepth => "another --max-depth",
        Difference::MaxSigma => "another --max-sigma",
        Difference::Camera => "another camera (--intrinsics, --calib)",
        Difference::FocalCorrection => "another --no-focal-correction",
        Difference::Stretch => "another --stretch",
        Difference::CorrectScale => "another --correct-scale",
        Difference::PostProcess => "another --post-process",
        _ => "other options",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_its_option() {
        let error = Error::Stale {
            path: "a.json".into(),
            why: StaleReason::MadeWith(Difference::MaxDepth),
        };
        let error = in_words(error);
        assert_eq!(
            error.to_string(),
            "a.json: already exists, made with another --max-depth"
        );
        assert!(
            error
                .hint()
                .is_some_and(|hint| hint.contains("--overwrite"))
        );
    }
}
