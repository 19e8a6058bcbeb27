//! How far the steering turns the vehicle, against what its gyro feels: wheelbase and steering ratio.

use super::finding::{Figure, Limit, Outcome, Severity};
use deepfusion_data::{Dataset, MotionModel};

const CHECK: &str = "steering";
/// Tyres slip in fast bends, and then the vehicle turns less than its wheels point.
const SLOW_MPS: f64 = 8.0;
/// Less turning tells no factor, seconds.
const LEAST_TURNING_S: f64 = 3.0;
/// The usual vehicle's slip at [`SLOW_MPS`] is 0.9.
const FACTOR: Limit = Limit::Within(0.8, 1.2);

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let Some(MotionModel::Fused(track)) = dataset.track() else {
        return Outcome::skipped(
            CHECK,
            "no steering angle and inertial unit beside the speed",
        );
    };
    if track.imu().is_none() {
        return Outcome::skipped(CHECK, "no inertial unit to compare the steering with");
    }
    if track.steering_yaw_rate().is_none() {
        let why = "no steering angle, or no vehicle.wheelbase_m to make it a yaw rate";
        return Outcome::skipped(CHECK, why);
    }
    let Some((factor, turning_s)) = track.gyro_over_steering(SLOW_MPS) else {
        return Outcome::skipped(CHECK, "the vehicle does not turn below 8 m/s");
    };
    if turning_s < LEAST_TURNING_S {
        let why = format!(
            "{turning_s:.1} s of turning below {SLOW_MPS} m/s, {LEAST_TURNING_S} s are needed"
        );
        return Outcome::skipped(CHECK, why);
    }
    let mut outcome = Outcome::new(CHECK);
    let figure = Figure::new(
        "turns by the gyro over turns by the steering",
        factor,
        "",
        FACTOR,
    );
    outcome.judge(Severity::Warning, figure, || {
        (
            format!(
                "in {turning_s:.0} s of turning the vehicle turned {factor:.2} times as far as its steering says: the \
                 wheelbase or the steering ratio is wrong"
            ),
            format!(
                "multiply vehicle.wheelbase_m by {:.2}, or vehicle.steering_ratio if that is the wrong one",
                1.0 / factor
            )
            .into(),
        )
    });
    outcome
}
