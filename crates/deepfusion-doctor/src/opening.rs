//! Whether everything can be read: the recording, its images, its motion.

use super::finding::{Outcome, Remedy, Severity};
use super::survey::Survey;
use deepfusion_data::{Dataset, Error, Result};
use deepfusion_hint::Hint;

pub(super) const CHECK: &str = "opening";
/// Pairs slower than this do not train.
const MIN_SPEED_MPS: f64 = 0.5;

/// How many pairs of a drive can train.
///
/// # Errors
/// Where none can, as [`Dataset::snippets`].
pub(super) fn pairs(dataset: &Dataset) -> Result<usize> {
    Ok(dataset.snippets(&[1], MIN_SPEED_MPS)?.len())
}

/// Of a recording that cannot be opened.
pub(super) fn failed(why: String, remedy: Option<Remedy>) -> Outcome {
    let mut outcome = Outcome::new(CHECK);
    let remedy = remedy.unwrap_or_else(|| "correct what the message names".into());
    outcome.find(Severity::Error, None, why, remedy);
    outcome
}

/// Of one that can: images that cannot be read, no pair to train on, and what was taken for granted.
/// A drive that merely has nothing to train on is left out where others of its folder have something, as training does.
pub(super) fn check(survey: &Survey<'_>, others_train: bool) -> Outcome {
    let mut outcome = Outcome::new(CHECK);
    for (number, problem) in &survey.unreadable {
        outcome.find(
            Severity::Error,
            Some(*number),
            problem.to_string(),
            "copy the recording again, or leave the frame out",
        );
    }
    if let Err(error) = pairs(survey.dataset) {
        let remedy = error
            .hint()
            .unwrap_or_else(|| "training needs pairs of frames with a known motion".into());
        let harmless = matches!(
            error,
            Error::OneFrame { .. } | Error::Standing { .. } | Error::NoPairs { .. }
        );
        let (severity, what) = if harmless && others_train {
            (Severity::Warning, "training leaves this drive out")
        } else {
            (Severity::Error, "no pair of frames can train")
        };
        outcome.find(severity, None, format!("{what}: {error}"), remedy);
    }
    if survey.dataset.track().is_some() && !survey.dataset.yaw_known() {
        outcome.find(
            Severity::Note,
            None,
            if survey.dataset.receiver().course_rate_radps.is_some() {
                "no yaw rate was recorded, but a track of positions: the clock can be checked, turns and the camera's direction cannot; \
                 training takes the turns from the images"
            } else {
                "no yaw rate was recorded: clock, turns and the camera's direction cannot be checked; training takes the turns from \
                 the images"
            }
            .into(),
            "record an inertial unit or the steering angle",
        );
    }
    for warning in survey.dataset.warnings() {
        let damaged = survey.dataset.damage().contains(warning);
        let severity = if damaged {
            Severity::Warning
        } else {
            Severity::Note
        };
        let remedy = if damaged {
            "copy the bag again; `rosbag reindex` (`ros2 bag reindex`) repairs one whose recording was cut off"
        } else if survey.dataset.passed_over() == Some(warning) {
            "give what is to be read as well by its own path"
        } else {
            "see that it is so, or say otherwise in the file beside the recording"
        };
        outcome.find(severity, None, warning.to_string(), remedy);
    }
    outcome
}
