//! Why the vehicle's motion is not known well enough for a check.

use deepfusion_hint::count_of;

/// Why the vehicle's motion is not known well enough for a check.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionSkip {
    /// There is neither a road nor poses to compare the speeds with.
    #[error("no visible road (too dark, too plain, or unknown turns), and no poses")]
    NoRoad,
    /// There is no LiDAR to compare the speeds with.
    #[error("no LiDAR with radial velocities, or no scans of it while the vehicle moves")]
    NoRadialVelocities,
    /// There are no two sources of dynamic points.
    #[error("no topic of dynamic points together with a LiDAR with radial velocities")]
    NoDynamicPoints,
    /// Too few points are dynamic.
    #[error("too few points move in {}", count_of(*scans, "scan"))]
    LittleDynamic {
        /// Number of scans that were examined.
        scans: usize,
    },
    /// There is neither a steering angle nor an inertial unit.
    #[error("no steering angle and inertial unit recorded with the speed")]
    NotFused,
    /// There is no inertial unit.
    #[error("no inertial unit to compare the steering with")]
    NoImu,
    /// No steering angle gives a yaw rate.
    #[error("no steering angle, or no vehicle.wheelbase_m to convert it to a yaw rate")]
    NoSteering,
    /// The vehicle does not turn at low speed.
    #[error("the vehicle does not turn below {below_mps} m/s")]
    NoSlowTurns {
        /// Speed below which turns are compared, m/s.
        below_mps: f64,
    },
    /// The vehicle turns too little at low speed.
    #[error("{turning_s:.1} s of turning below {below_mps} m/s, expected at least {needed_s} s")]
    FewSlowTurns {
        /// Time during which it turns, seconds.
        turning_s: f64,
        /// Speed below which turns are compared, m/s.
        below_mps: f64,
        /// The time that is needed, seconds.
        needed_s: f64,
    },
    /// Too few pictures show a turn.
    #[error("{} with a turn, expected at least {needed}", count_of(*pairs, "pair"))]
    FewTurns {
        /// Number of pairs with a turn.
        pairs: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The vehicle drives straight ahead.
    #[error(
        "the vehicle hardly turns (yaw rate ±{spread_radps:.3} rad/s, expected at least {needed_radps})"
    )]
    HardlyTurns {
        /// The standard deviation of its yaw rate, rad/s.
        spread_radps: f64,
        /// The standard deviation that is needed, rad/s.
        needed_radps: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skip_reasons_have_their_messages() {
        for (reason, message) in [
            (
                MotionSkip::NoRoad,
                "no visible road (too dark, too plain, or unknown turns), and no poses",
            ),
            (
                MotionSkip::NoDynamicPoints,
                "no topic of dynamic points together with a LiDAR with radial velocities",
            ),
            (
                MotionSkip::LittleDynamic { scans: 40 },
                "too few points move in 40 scans",
            ),
            (
                MotionSkip::NotFused,
                "no steering angle and inertial unit recorded with the speed",
            ),
            (
                MotionSkip::NoImu,
                "no inertial unit to compare the steering with",
            ),
            (
                MotionSkip::NoSteering,
                "no steering angle, or no vehicle.wheelbase_m to convert it to a yaw rate",
            ),
            (
                MotionSkip::NoSlowTurns { below_mps: 8.0 },
                "the vehicle does not turn below 8 m/s",
            ),
            (
                MotionSkip::FewSlowTurns {
                    turning_s: 1.26,
                    below_mps: 8.0,
                    needed_s: 3.0,
                },
                "1.3 s of turning below 8 m/s, expected at least 3 s",
            ),
            (
                MotionSkip::FewTurns {
                    pairs: 1,
                    needed: 15,
                },
                "1 pair with a turn, expected at least 15",
            ),
            (
                MotionSkip::HardlyTurns {
                    spread_radps: 0.0042,
                    needed_radps: 0.015,
                },
                "the vehicle hardly turns (yaw rate ±0.004 rad/s, expected at least 0.015)",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
