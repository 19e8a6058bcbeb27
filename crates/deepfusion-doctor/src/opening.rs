//! Whether everything can be read: the recording, its images, its motion.

use super::finding::{Outcome, Severity};
use super::reason::{FindingReason, OpeningReason};
use super::survey::Survey;
use deepfusion_data::{Dataset, Error, Result};

pub(super) const CHECK: &str = "opening";
/// Pairs slower than this are not used for training.
const MIN_SPEED_MPS: f64 = 0.5;

/// How many pairs of a drive can be used for training.
///
/// # Errors
/// If none can, as [`Dataset::snippets`].
pub(super) fn pairs(dataset: &Dataset) -> Result<usize> {
    Ok(dataset.snippets(&[1], MIN_SPEED_MPS)?.len())
}

/// The outcome for a recording that cannot be opened.
pub(super) fn failed(why: FindingReason) -> Outcome {
    let mut outcome = Outcome::new(CHECK);
    outcome.find(Severity::Error, None, why);
    outcome
}

/// The outcome for a recording that can be opened: images that cannot be read, no pair to train on, and what was assumed.
/// A drive whose only fault is that it has no pair to train on is left out, as in training, if other drives of its folder have some.
pub(super) fn check(survey: &Survey<'_>, others_train: bool) -> Outcome {
    let mut outcome = Outcome::new(CHECK);
    for (number, problem) in &survey.unreadable {
        outcome.find(
            Severity::Error,
            Some(*number),
            OpeningReason::Image(problem.clone()),
        );
    }
    if let Err(error) = pairs(survey.dataset) {
        let harmless = matches!(
            error,
            Error::OneFrame { .. } | Error::Standing { .. } | Error::NoPairs { .. }
        );
        let left_out = harmless && others_train;
        let severity = if left_out {
            Severity::Warning
        } else {
            Severity::Error
        };
        let problem = error.into();
        let what = OpeningReason::NoPair { left_out, problem };
        outcome.find(severity, None, what);
    }
    if survey.dataset.track().is_some() && !survey.dataset.yaw_known() {
        outcome.find(
            Severity::Note,
            None,
            if survey.dataset.receiver().course_rate_radps.is_some() {
                OpeningReason::CourseAlone
            } else {
                OpeningReason::NoTurns
            },
        );
    }
    for warning in survey.dataset.warnings() {
        let damaged = survey.dataset.damage().contains(warning);
        let severity = if damaged {
            Severity::Warning
        } else {
            Severity::Note
        };
        outcome.find(severity, None, OpeningReason::from(warning.clone()));
    }
    outcome
}
