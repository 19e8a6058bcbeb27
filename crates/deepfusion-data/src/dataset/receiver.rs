//! What a satellite receiver's track says beside the speeds.

use deepfusion_motion::Signal;

/// What a satellite receiver's track says beside the speeds, on the frames' clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Receiver {
    /// How the course over ground turned where the vehicle moved, in rad/s, positive to the left. It is spread over a second or
    /// so: enough for the offset of two clocks, not for a camera's turn between two frames.
    pub course_rate_radps: Option<Signal>,
    /// Standard deviation of the speeds, in m/s; of other logs that say how sure they are, too.
    pub speed_sigma_mps: Option<Signal>,
}
