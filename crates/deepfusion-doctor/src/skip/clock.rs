//! Why the offset of the camera's clock and the vehicle's cannot be found.

use crate::camera_ahead::NoCameraAhead;
use deepfusion_motion::NoTimeOffset;

/// Why the offset of the camera's clock and the vehicle's cannot be found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClockSkip {
    /// Nothing was recorded to compare the pictures with.
    #[error("no speed and yaw rate to compare the picture with")]
    NoRates,
    /// A course of positions does not show it. The drive that the reason names is the one that is checked.
    #[error("{}", .0.reason())]
    ByCourse(NoCameraAhead),
    /// The picture's motion does not match the vehicle's.
    #[error(transparent)]
    NotFound(#[from] NoTimeOffset),
    /// The offset is not known well enough.
    #[error("the estimate of {offset_s:.2} s has a standard error of {std_error_s:.2} s")]
    Unsure {
        /// The offset, vehicle minus camera, seconds.
        offset_s: f64,
        /// Its standard error, seconds.
        std_error_s: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The messages leave out the drive's name, which is printed beside them.
    #[test]
    fn skip_reasons_have_their_messages() {
        let drive = "monday".to_owned();
        for (reason, message) in [
            (
                ClockSkip::ByCourse(NoCameraAhead::NoSpeeds { drive }),
                "the clocks cannot be compared: there are no speeds, or the frames have no times",
            ),
            (
                NoTimeOffset::NothingChanges.into(),
                "time offset: the motion does not change: no turn above 0.004 rad/s, no change of speed above 0.1 m/s",
            ),
            (
                ClockSkip::Unsure {
                    offset_s: 0.304,
                    std_error_s: 0.12,
                },
                "the estimate of 0.30 s has a standard error of 0.12 s",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
