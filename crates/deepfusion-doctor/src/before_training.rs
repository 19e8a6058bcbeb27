//! The checks that training makes by itself. They take about a second a drive, and what they find would make training pointless.

use super::finding::{Finding, Outcome, Severity};
use super::reason::{FindingReason, MotionReason};
use super::survey::Survey;
use super::{epipolar, intrinsics, turn};
use deepfusion_data::{DataWarning, Dataset, Ego, Frame, MotionWarning};

/// Frames and pairs that are read.
const SURVEY: (usize, usize) = (120, 60);

/// The worst finding about a drive's intrinsics, for images of its size; none about a camera that is
/// [assumed](Dataset::camera_assumed). No image is read.
#[must_use]
pub fn camera_finding(dataset: &Dataset) -> Option<Finding> {
    if dataset.camera_assumed() {
        return None;
    }
    worst(intrinsics::check(&dataset.intrinsics(0)))
}

/// What makes it pointless to train on a drive's turns: its images turn the other way, or by another angle than its focal length gives.
/// Reads up to 120 images, and none if no yaw rate was measured or the vehicle hardly turns.
#[must_use]
pub fn turn_finding(dataset: &Dataset) -> Option<Finding> {
    if !turns_measured(dataset) || turn::spread(&yaw_rates(dataset)) < turn::LEAST_TURN {
        return None;
    }
    let survey = Survey::sized(dataset, SURVEY);
    let finding = worst(turn::check(&epipolar::pairs(&survey)))?;
    let of_focal_length = matches!(
        finding.what,
        FindingReason::Motion(MotionReason::TurnsFactor { .. })
    );
    let known_to_be_off = of_focal_length && dataset.camera_assumed();
    (finding.severity == Severity::Error && !known_to_be_off).then_some(finding)
}

/// Whether a sensor measured the turns. Turns that were taken from the images always agree with them.
fn turns_measured(dataset: &Dataset) -> bool {
    let of_images = |warning: &DataWarning| {
        matches!(
            warning,
            DataWarning::Motion(MotionWarning::TurnsOfImages {
                yaw_recorded: false,
                ..
            })
        )
    };
    dataset.yaw_known() && !dataset.warnings().iter().any(of_images)
}

/// The vehicle's yaw rates from frame to frame, rad/s.
fn yaw_rates(dataset: &Dataset) -> Vec<f64> {
    let Ok(ego) = dataset.ego().map(Ego::level) else {
        return Vec::new();
    };
    let rate = |pair: &[Frame]| {
        let (from_s, to_s) = pair[0].time_s.zip(pair[1].time_s)?;
        let motion = ego.vehicle_motion(from_s, to_s)?;
        Some(motion.yaw_rad / (to_s - from_s))
    };
    let rates = dataset.frames().windows(2).filter_map(rate);
    rates.filter(|rate| rate.is_finite()).collect()
}

/// The first of the worst findings.
fn worst(outcome: Outcome) -> Option<Finding> {
    let findings = outcome.findings.into_iter().rev();
    findings.max_by_key(|finding| finding.severity)
}
