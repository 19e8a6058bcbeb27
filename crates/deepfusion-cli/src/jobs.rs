//! What the library says of work over recordings and folders, in the command line's words.

use deepfusion_jobs::{Error, OtherJob, StaleReason};
use deepfusion_records::Difference;

use crate::error::CliError;

/// An error whose message speaks of options here.
pub fn in_words(error: Error) -> anyhow::Error {
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
        // Told, and looked into, as where it came from says it.
        Error::Data(error) => error.into(),
        #[cfg(feature = "train")]
        Error::Train(error) => error.into(),
        other => other.into(),
    }
}

/// What to do about it, with the options that do it.
pub fn hint(error: &Error) -> Option<String> {
    match error {
        Error::Exists { .. } => {
            Some("allow it with --overwrite, or choose another folder".into())
        }
        Error::Stale { .. } => Some(
            "--overwrite replaces what was made differently; or choose another folder".into(),
        ),
        Error::OtherJob { .. } => Some(
            "start every shard with the same inputs and options; --overwrite begins anew, or choose another folder".into(),
        ),
        Error::Busy { .. } => {
            Some("wait for it, or share the work with --shard I/N, a different I each".into())
        }
        Error::Incomplete { .. } => Some(
            "give the folder that holds every drive that the split names, or leave --strict out to use what is there".into(),
        ),
        Error::NothingToPack { .. } => {
            Some("train from it first: deepfusion train --data DRIVE --init RUN".into())
        }
        other => other.hint(),
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
            "a.json: is there already, made with another --max-depth"
        );
        assert!(crate::error::hint_of(&error).is_some_and(|hint| hint.contains("--overwrite")));
    }
}
