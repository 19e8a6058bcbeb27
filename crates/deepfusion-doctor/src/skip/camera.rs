//! Why the camera's direction cannot be found.

use crate::reason::HeadingAngle;
use deepfusion_hint::{Hint, count_of};
use std::fmt;

/// Why the camera's direction cannot be found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraSkip {
    /// Too few pictures were taken driving straight ahead.
    #[error(transparent)]
    Heading(#[from] NoHeading),
    /// No angle is known well enough.
    #[error("too uncertain: {}", together(.0))]
    Unsure(Vec<UnsureHeading>),
    /// The camera's mount is unknown.
    #[error("the camera's mount on the vehicle is unknown")]
    NoMount,
    /// Too little of the road was measured.
    #[error(
        "the measured depth shows the road ahead in {}, expected at least {needed}",
        count_of(*frames, "frame")
    )]
    LittleRoad {
        /// Frames that show the road.
        frames: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The depth measured ahead of the camera is not only of the road.
    #[error(
        "the planes before the camera differ between frames (pitch by {pitch_deg:.1} degrees, roll by {roll_deg:.1}): they are not the road alone"
    )]
    UnevenRoad {
        /// How far the pitch scatters, degrees.
        pitch_deg: f64,
        /// How far the roll scatters, degrees.
        roll_deg: f64,
    },
    /// The two cameras have too few points in common.
    #[error("too few points are seen by both cameras")]
    FewPoints,
    /// The recording has only one camera.
    #[error("the recording has one camera")]
    OneCamera,
}

/// An angle of the camera's direction of travel whose standard error is too large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnsureHeading {
    /// The angle.
    pub angle: HeadingAngle,
    /// Difference from the mount, degrees: up and to the right are positive.
    pub off_deg: f64,
    /// The standard error of that, degrees.
    pub std_error_deg: f64,
}

impl fmt::Display for UnsureHeading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            angle,
            off_deg,
            std_error_deg,
        } = self;
        write!(
            f,
            "{angle} of the direction of travel {off_deg:.1} ± {std_error_deg:.1} degrees"
        )
    }
}

fn together(unsure: &[UnsureHeading]) -> String {
    let unsure: Vec<String> = unsure.iter().map(UnsureHeading::to_string).collect();
    unsure.join(", ")
}

/// Too few images from which to find the camera's direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{} straight ahead, expected at least {needed}", count_of(*straight, "pair"))]
#[non_exhaustive]
pub struct NoHeading {
    /// Number of pairs that were taken driving straight ahead.
    pub straight: usize,
    /// How many are needed.
    pub needed: usize,
}

impl Hint for NoHeading {
    fn hint(&self) -> Option<String> {
        Some("use a drive with more straight stretches, or give the camera's mount".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skip_reasons_have_their_messages() {
        let unsure = |angle| UnsureHeading {
            angle,
            off_deg: -0.44,
            std_error_deg: 0.71,
        };
        for (reason, message) in [
            (
                CameraSkip::Heading(NoHeading {
                    straight: 1,
                    needed: 12,
                }),
                "1 pair straight ahead, expected at least 12",
            ),
            (
                CameraSkip::Unsure([HeadingAngle::Pitch, HeadingAngle::Yaw].map(unsure).into()),
                "too uncertain: pitch of the direction of travel -0.4 ± 0.7 degrees, yaw of the direction of travel -0.4 ± 0.7 degrees",
            ),
            (
                CameraSkip::NoMount,
                "the camera's mount on the vehicle is unknown",
            ),
            (
                CameraSkip::LittleRoad {
                    frames: 3,
                    needed: 4,
                },
                "the measured depth shows the road ahead in 3 frames, expected at least 4",
            ),
            (
                CameraSkip::UnevenRoad {
                    pitch_deg: 1.26,
                    roll_deg: 2.0,
                },
                "the planes before the camera differ between frames (pitch by 1.3 degrees, roll by 2.0): they are not the road alone",
            ),
            (
                CameraSkip::FewPoints,
                "too few points are seen by both cameras",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
