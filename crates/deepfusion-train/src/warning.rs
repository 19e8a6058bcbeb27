//! Warnings of a training run.

use deepfusion_hint::count_of;

/// Something looks wrong in a run, but training continues.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrainWarning {
    /// A camera is learned, and no pair of frames has a measured turn.
    #[error(
        "the camera is learned without measured turns: only sharp turns determine the focal length then; a yaw rate with view_motion auto \
         determines it much better"
    )]
    NoMeasuredTurns,
    /// A camera is learned, and the vehicle hardly turns.
    #[error(
        "the vehicle hardly turns, {:.2} degrees from image to image: these drives will not determine the camera's focal length; add some with bends",
        mean_rad.to_degrees()
    )]
    HardlyTurns {
        /// The mean turn between the frames of a pair, in radians.
        mean_rad: f64,
    },
    /// A camera is learned, and the measured turns are not used.
    #[error(
        "the camera is learned with PoseNet's turns, which determine it only where they are sharp; the measured turns (view_motion auto) \
         determine it much better"
    )]
    MeasuredTurnsUnused,
    /// The learned camera is not determined: others would explain the images equally well.
    #[error(
        "the drives do not determine the camera's focal length: without turns (with PoseNet's turns, without sharp ones) another focal \
         length explains the images equally well; do not rely on the metres, nor on depth that is not straight ahead"
    )]
    CameraUndetermined,
    /// Drives with unknown turns in a run with `view_motion` `auto`.
    #[error(
        "the turns of {drive}{} are not known: warped by PoseNet's motion at the measured distance",
        and_others(*others)
    )]
    NoTurns {
        /// The first of these drives.
        drive: String,
        /// Number of the other drives.
        others: usize,
    },
    /// One of several data sets has cameras with different focal lengths.
    #[error(
        "a data set has several focal lengths and no canonical_focal_px, so its metres fit none of its cameras; set canonical_focal_px, \
         or give each camera a data set of its own"
    )]
    SeveralFocalLengths,
    /// Drives with only one camera in a run with stereo.
    #[error(
        "{drive}{} {} from {} own frames alone",
        and_others(*others),
        if *others == 0 { "has one camera: it learns" } else { "have one camera: they learn" },
        if *others == 0 { "its" } else { "their" }
    )]
    OneCamera {
        /// The first of these drives.
        drive: String,
        /// Number of the other drives.
        others: usize,
    },
    /// A step's gradient is infinite or NaN.
    #[error("step skipped: the gradient is not finite (frames {})", frames.join(", "))]
    StepSkipped {
        /// The drives and frames of its samples.
        frames: Vec<String>,
    },
    /// Few pixels are in view of the frame to which they are warped: the geometry has diverged.
    #[error(
        "only {:.0} % of the pixels are in view of the other frame: depth or motion has diverged",
        100.0 * share
    )]
    FewInView {
        /// The share of pixels, 0 to 1.
        share: f64,
    },
    /// The masks of dynamic pixels remove too much of what depth should learn from.
    #[error(
        "{:.0} % of the pixels count as dynamic: the flow explains more than depth and motion do; a longer warm-up \
         (`loss.moving.warmup_share`) lets depth learn first",
        100.0 * share
    )]
    ManyDynamic {
        /// The share of pixels, 0 to 1.
        share: f64,
    },
}

/// The number of drives beside the named one, as text.
fn and_others(others: usize) -> String {
    match others {
        0 => String::new(),
        n => format!(" and {}", count_of(n, "other drive")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_about_a_learned_camera() {
        for (warning, message) in [
            (
                TrainWarning::NoMeasuredTurns,
                "the camera is learned without measured turns: only sharp turns determine the focal length then; a yaw rate with \
                 view_motion auto determines it much better",
            ),
            (
                TrainWarning::HardlyTurns {
                    mean_rad: 0.25_f64.to_radians(),
                },
                "the vehicle hardly turns, 0.25 degrees from image to image: these drives will not determine the camera's focal length; add \
                 some with bends",
            ),
            (
                TrainWarning::MeasuredTurnsUnused,
                "the camera is learned with PoseNet's turns, which determine it only where they are sharp; the measured turns \
                 (view_motion auto) determine it much better",
            ),
            (
                TrainWarning::CameraUndetermined,
                "the drives do not determine the camera's focal length: without turns (with PoseNet's turns, without sharp ones) another \
                 focal length explains the images equally well; do not rely on the metres, nor on depth that is not straight ahead",
            ),
        ] {
            assert_eq!(warning.to_string(), message);
        }
    }

    #[test]
    fn drives_with_missing_measurements_are_counted() {
        let no_turns = |others| {
            let drive = "monday".into();
            TrainWarning::NoTurns { drive, others }.to_string()
        };
        let one_camera = |others| {
            let drive = "monday".into();
            TrainWarning::OneCamera { drive, others }.to_string()
        };
        let warped = "warped by PoseNet's motion at the measured distance";
        for (others, and) in [
            (0, ""),
            (1, " and 1 other drive"),
            (2, " and 2 other drives"),
        ] {
            assert_eq!(
                no_turns(others),
                format!("the turns of monday{and} are not known: {warped}")
            );
        }
        assert_eq!(
            one_camera(0),
            "monday has one camera: it learns from its own frames alone"
        );
        assert_eq!(
            one_camera(1),
            "monday and 1 other drive have one camera: they learn from their own frames alone"
        );
        assert_eq!(
            one_camera(2),
            "monday and 2 other drives have one camera: they learn from their own frames alone"
        );
    }

    #[test]
    fn warnings_about_steps() {
        for (warning, message) in [
            (
                TrainWarning::StepSkipped {
                    frames: vec!["monday/7".into(), "monday/9".into()],
                },
                "step skipped: the gradient is not finite (frames monday/7, monday/9)",
            ),
            (
                TrainWarning::FewInView { share: 0.124 },
                "only 12 % of the pixels are in view of the other frame: depth or motion has diverged",
            ),
            (
                TrainWarning::ManyDynamic { share: 0.57 },
                "57 % of the pixels count as dynamic: the flow explains more than depth and motion do; a longer warm-up \
                 (`loss.moving.warmup_share`) lets depth learn first",
            ),
        ] {
            assert_eq!(warning.to_string(), message);
        }
    }
}
