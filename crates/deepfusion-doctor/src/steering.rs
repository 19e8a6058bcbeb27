//! How far the vehicle turns according to its steering, compared with its gyroscope: wheelbase and steering ratio.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::MotionReason;
use super::skip::MotionSkip;
use deepfusion_data::{Dataset, MotionModel};

const CHECK: &str = "steering";
/// In fast bends the tyres slip, and the vehicle turns less than its wheels point.
const SLOW_MPS: f64 = 8.0;
/// Less turning does not give a factor, seconds.
const LEAST_TURNING_S: f64 = 3.0;
/// The usual vehicle's slip at [`SLOW_MPS`] is 0.9.
const FACTOR: Limit = Limit::Within(0.8, 1.2);

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let Some(MotionModel::Fused(track)) = dataset.track() else {
        return Outcome::skipped(CHECK, MotionSkip::NotFused);
    };
    if track.imu().is_none() {
        return Outcome::skipped(CHECK, MotionSkip::NoImu);
    }
    if track.steering_yaw_rate().is_none() {
        return Outcome::skipped(CHECK, MotionSkip::NoSteering);
    }
    let Some((factor, turning_s)) = track.gyro_over_steering(SLOW_MPS) else {
        let below_mps = SLOW_MPS;
        return Outcome::skipped(CHECK, MotionSkip::NoSlowTurns { below_mps });
    };
    if turning_s < LEAST_TURNING_S {
        let why = MotionSkip::FewSlowTurns {
            turning_s,
            below_mps: SLOW_MPS,
            needed_s: LEAST_TURNING_S,
        };
        return Outcome::skipped(CHECK, why);
    }
    let mut outcome = Outcome::new(CHECK);
    let figure = Figure::new(
        "turns by the gyroscope over turns by the steering",
        factor,
        "",
        FACTOR,
    );
    outcome.judge(Severity::Warning, figure, || MotionReason::Steering {
        turning_s,
        factor,
    });
    outcome
}
