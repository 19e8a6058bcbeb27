//! Why nothing shows how the vehicle moved.

use deepfusion_hint::count_of;

/// Why nothing shows how the vehicle moved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionSkip {
    /// Neither road nor poses tell of the speeds.
    #[error("no road to see (too dark, too plain, or turns that nothing shows), and no poses")]
    NoRoad,
    /// No LiDAR tells of the speeds.
    #[error("no LiDAR with radial velocities, or no scans of it while the vehicle moves")]
    NoRadialVelocities,
    /// No two sources of dynamic points are there.
    #[error("no topic of dynamic points beside a LiDAR with radial velocities")]
    NoDynamicPoints,
    /// Too few points are dynamic.
    #[error("too little moves in {}", count_of(*scans, "scan"))]
    LittleDynamic {
        /// Scans that were looked at.
        scans: usize,
    },
    /// Neither steering angle nor inertial unit is there.
    #[error("no steering angle and inertial unit beside the speed")]
    NotFused,
    /// No inertial unit is there.
    #[error("no inertial unit to compare the steering with")]
    NoImu,
    /// No steering angle says a yaw rate.
    #[error("no steering angle, or no vehicle.wheelbase_m to make it a yaw rate")]
    NoSteering,
    /// The vehicle does not turn where it is slow.
    #[error("the vehicle does not turn below {below_mps} m/s")]
    NoSlowTurns {
        /// What is slow, m/s.
        below_mps: f64,
    },
    /// It turns too little where it is slow.
    #[error("{turning_s:.1} s of turning below {below_mps} m/s, {needed_s} s are needed")]
    FewSlowTurns {
        /// For how long it does, seconds.
        turning_s: f64,
        /// What is slow, m/s.
        below_mps: f64,
        /// For how long is needed, seconds.
        needed_s: f64,
    },
    /// Too few pictures show a turn.
    #[error("{} with a turn, {needed} are needed", count_of(*pairs, "pair"))]
    FewTurns {
        /// Pairs of them that do.
        pairs: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The vehicle drives straight on.
    #[error(
        "the vehicle hardly turns (yaw rate ±{spread_radps:.3} rad/s, {needed_radps} are needed)"
    )]
    HardlyTurns {
        /// The standard deviation of its yaw rate, rad/s.
        spread_radps: f64,
        /// What is needed, rad/s.
        needed_radps: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_motion_lacks_is_said() {
        for (reason, said) in [
            (
                MotionSkip::NoRoad,
                "no road to see (too dark, too plain, or turns that nothing shows), and no poses",
            ),
            (
                MotionSkip::NoDynamicPoints,
                "no topic of dynamic points beside a LiDAR with radial velocities",
            ),
            (
                MotionSkip::LittleDynamic { scans: 40 },
                "too little moves in 40 scans",
            ),
            (
                MotionSkip::NotFused,
                "no steering angle and inertial unit beside the speed",
            ),
            (
                MotionSkip::NoImu,
                "no inertial unit to compare the steering with",
            ),
            (
                MotionSkip::NoSteering,
                "no steering angle, or no vehicle.wheelbase_m to make it a yaw rate",
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
                "1.3 s of turning below 8 m/s, 3 s are needed",
            ),
            (
                MotionSkip::FewTurns {
                    pairs: 1,
                    needed: 15,
                },
                "1 pair with a turn, 15 are needed",
            ),
            (
                MotionSkip::HardlyTurns {
                    spread_radps: 0.0042,
                    needed_radps: 0.015,
                },
                "the vehicle hardly turns (yaw rate ±0.004 rad/s, 0.015 are needed)",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }
}
