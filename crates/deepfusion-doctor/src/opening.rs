//! Whether everything can be read: the recording, its images, its motion.

use super::finding::{Outcome, Severity};
use super::reason::{FindingReason, OpeningReason};
use super::remedy::{OpeningRemedy, Remedy};
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
pub(super) fn failed(why: FindingReason, remedy: Option<Remedy>) -> Outcome {
    let mut outcome = Outcome::new(CHECK);
    let remedy = remedy.unwrap_or(OpeningRemedy::Correct.into());
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
            OpeningReason::Image(problem.clone()),
            OpeningRemedy::CopyOrLeaveOut,
        );
    }
    if let Err(error) = pairs(survey.dataset) {
        let remedy = error
            .hint()
            .map_or(OpeningRemedy::KnownMotion.into(), Remedy::Hint);
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
        outcome.find(severity, None, what, remedy);
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
            OpeningRemedy::RecordTurns,
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
            OpeningRemedy::RepairBag
        } else if survey.dataset.passed_over() == Some(warning) {
            OpeningRemedy::OwnPath
        } else {
            OpeningRemedy::SayOtherwise
        };
        let what = OpeningReason::from(warning.clone());
        outcome.find(severity, None, what, remedy);
    }
    outcome
}
