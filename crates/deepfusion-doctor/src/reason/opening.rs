//! What cannot be read of a recording, or was assumed about it.

use crate::shared_error::SharedError;
use deepfusion_data::{DataWarning, Error};
use deepfusion_hint::Hint;

/// What cannot be read of a recording, or was assumed about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpeningReason {
    /// The recording cannot be opened.
    #[error(transparent)]
    Recording(SharedError<Error>),
    /// An image cannot be read.
    #[error(transparent)]
    Image(SharedError<Error>),
    /// The drive has no pair of frames to learn from.
    #[error(
        "{}: {problem}",
        if *left_out { "training leaves this drive out" } else { "no pair of frames can be used for training" }
    )]
    NoPair {
        /// Whether training continues without it: other drives of its folder have pairs, and nothing else is wrong with it.
        left_out: bool,
        /// Why it has no such pair.
        problem: SharedError<Error>,
    },
    /// No turns were recorded.
    #[error(
        "no yaw rate was recorded: clock, turns and the camera's direction cannot be checked; training takes the turns from the images"
    )]
    NoTurns,
    /// Turns are known from a course of positions alone.
    #[error(
        "no yaw rate was recorded, only a track of positions: the clock can be checked, but not turns and the camera's direction; training takes the turns from the images"
    )]
    CourseAlone,
    /// A warning given on opening the recording.
    #[error(transparent)]
    Warning(#[from] DataWarning),
}

impl OpeningReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::Recording(error) => {
                return error.hint().unwrap_or_else(|| super::CORRECT.to_owned());
            }
            Self::Image(_) => "copy the recording again, or leave out the frame",
            Self::NoPair { problem, .. } => {
                let known = "training needs pairs of frames with a known motion";
                return problem.hint().unwrap_or_else(|| known.to_owned());
            }
            Self::NoTurns | Self::CourseAlone => "record an inertial unit or the steering angle",
            Self::Warning(warning) => super::assumed::hint(warning),
        };
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::CameraWarning;
    use std::io::ErrorKind;
    use std::path::Path;

    #[test]
    fn a_drive_without_pairs_is_left_out_or_fails() {
        let error = Error::file(Path::new("drive"), ErrorKind::NotFound.into());
        let message = error.to_string();
        let problem = SharedError::from(error);
        for (left_out, what) in [
            (true, "training leaves this drive out"),
            (false, "no pair of frames can be used for training"),
        ] {
            let problem = problem.clone();
            let reason = OpeningReason::NoPair { left_out, problem };
            assert_eq!(reason.to_string(), format!("{what}: {message}"));
        }
        assert_eq!(OpeningReason::Image(problem.clone()).to_string(), message);
        assert_eq!(OpeningReason::Recording(problem).to_string(), message);
    }

    #[test]
    fn assumptions_have_their_messages() {
        assert_eq!(
            OpeningReason::NoTurns.to_string(),
            "no yaw rate was recorded: clock, turns and the camera's direction cannot be checked; training takes the turns from the images"
        );
        let warning = DataWarning::from(CameraWarning::LensCorrected);
        let message = warning.to_string();
        assert_eq!(OpeningReason::from(warning).to_string(), message);
    }
}
