//! What looks wrong while a run is trained.

use deepfusion_hint::count_of;

/// What looks wrong in a run, though its training goes on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrainWarning {
    /// The camera is learned, and no pair of frames has a measured turn.
    #[error(
        "the camera is learned without measured turns: only strong ones determine the focal length then; a yaw rate and view_motion auto determine it much better"
    )]
    NoMeasuredTurns,
    /// The camera is learned, and the vehicle drives straight on.
    #[error(
        "the vehicle hardly turns, {:.2} degrees from image to image: these drives will not determine the camera's focal length; add some with bends",
        mean_rad.to_degrees()
    )]
    HardlyTurns {
        /// The mean turn between the frames of a pair.
        mean_rad: f64,
    },
    /// The camera is learned, and the measured turns are not used.
    #[error(
        "the camera is learned with the turns that PoseNet finds, which determine it only where they are strong; the measured ones, view_motion auto, determine it much better"
    )]
    MeasuredTurnsUnused,
    /// The camera was learned, and could as well be another.
    #[error(
        "the drives do not determine the camera's focal length: without turns (and, with the turns of a network, without strong ones) another focal length explains the images as well; depth of what is not straight ahead is not to be relied on, nor its metres"
    )]
    CameraUndetermined,
    /// Drives without turns in a run that takes what each one's sensors know.
    #[error(
        "no turns are known of {drive}{}: warped by PoseNet's at the measured distance",
        and_others(*others)
    )]
    NoTurns {
        /// The first of them.
        drive: String,
        /// How many more there are.
        others: usize,
    },
    /// Cameras of several focal lengths in one of several data sets.
    #[error(
        "a data set has several focal lengths, and no canonical_focal_px: its metres are then those of no camera in particular; name one, or give each camera a set of its own"
    )]
    SeveralFocalLengths,
    /// Drives of one camera in a run that has stereo.
    #[error(
        "{drive}{} {} from {} own frames alone",
        and_others(*others),
        if *others == 0 { "has one camera: it learns" } else { "have one camera: they learn" },
        if *others == 0 { "its" } else { "their" }
    )]
    OneCamera {
        /// The first of them.
        drive: String,
        /// How many more there are.
        others: usize,
    },
    /// A step's gradient is infinite or NaN.
    #[error("step skipped: the gradient is not finite (frames {})", frames.join(", "))]
    StepSkipped {
        /// What the step would have learned from.
        frames: Vec<String>,
    },
    /// Few pixels are in view of the frame that they are compared with: the geometry has diverged.
    #[error(
        "only {:.0} % of the pixels are in view of the other frame: depth or motion has come apart",
        100.0 * share
    )]
    FewInView {
        /// Their share, 0 to 1.
        share: f64,
    },
    /// The masks of dynamic pixels remove too much of what depth should learn from.
    #[error(
        "{:.0} % of the pixels are taken to move by themselves: the flow explains more than depth and motion do; a longer warm-up (`loss.moving.warmup_share`) lets depth learn first",
        100.0 * share
    )]
    ManyDynamic {
        /// Their share, 0 to 1.
        share: f64,
    },
}

/// So many drives beside the one that is named.
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
    fn what_is_said_of_a_camera_that_is_learned() {
        for (warning, said) in [
            (
                TrainWarning::NoMeasuredTurns,
                "the camera is learned without measured turns: only strong ones determine the focal length then; a yaw rate and \
                 view_motion auto determine it much better",
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
                "the camera is learned with the turns that PoseNet finds, which determine it only where they are strong; the measured ones, \
                 view_motion auto, determine it much better",
            ),
            (
                TrainWarning::CameraUndetermined,
                "the drives do not determine the camera's focal length: without turns (and, with the turns of a network, without strong \
                 ones) another focal length explains the images as well; depth of what is not straight ahead is not to be relied on, nor \
                 its metres",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }

    #[test]
    fn drives_that_know_less_are_counted() {
        let no_turns = |others| {
            let drive = "monday".into();
            TrainWarning::NoTurns { drive, others }.to_string()
        };
        let one_camera = |others| {
            let drive = "monday".into();
            TrainWarning::OneCamera { drive, others }.to_string()
        };
        let warped = "warped by PoseNet's at the measured distance";
        for (others, and) in [
            (0, ""),
            (1, " and 1 other drive"),
            (2, " and 2 other drives"),
        ] {
            assert_eq!(
                no_turns(others),
                format!("no turns are known of monday{and}: {warped}")
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
    fn what_is_said_of_steps() {
        for (warning, said) in [
            (
                TrainWarning::StepSkipped {
                    frames: vec!["monday/7".into(), "monday/9".into()],
                },
                "step skipped: the gradient is not finite (frames monday/7, monday/9)",
            ),
            (
                TrainWarning::FewInView { share: 0.124 },
                "only 12 % of the pixels are in view of the other frame: depth or motion has come apart",
            ),
            (
                TrainWarning::ManyDynamic { share: 0.57 },
                "57 % of the pixels are taken to move by themselves: the flow explains more than depth and motion do; a longer warm-up \
                 (`loss.moving.warmup_share`) lets depth learn first",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }
}
