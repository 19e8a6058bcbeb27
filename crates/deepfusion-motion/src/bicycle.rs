//! The kinematic bicycle model: yaw rate from speed and steering angle (Eq. 26–27).

use crate::{Error, ExpectedSetting as Expected, Result, Signal};
use serde::{Deserialize, Serialize};

/// The kinematic bicycle model: one wheel per axle, without slip.
///
/// θ̇ = v / L · tan δ (Eq. 27), where v is the forward speed of the middle of the **rear axle**, which is the vehicle's origin; L is the
/// wheelbase; δ is the road wheels' angle. A steering wheel's angle s gives δ = (s − offset) / ratio; a signal that already is the road
/// wheels' angle has ratio 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bicycle {
    /// Distance between the axles, in metres.
    pub wheelbase_m: f64,
    /// Ratio of the steering wheel's angle to the road wheels' angle; 1 if the signal is the road wheels' angle.
    #[serde(default = "one")]
    pub steering_ratio: f64,
    /// Reading of the steering signal when the car drives straight, in radians.
    #[serde(default)]
    pub steering_offset_rad: f64,
    /// Understeer K, in s²/m²: tyres slip in fast bends, θ̇ = v tan δ / (L (1 + K v²)). 0, the
    /// default, is Eq. 27; cars have 0.001 to 0.003.
    #[serde(default)]
    pub understeer_s2_per_m2: f64,
}

fn one() -> f64 {
    1.0
}

impl Bicycle {
    /// A vehicle whose signal is the road wheels' angle, without understeer.
    #[must_use]
    pub fn new(wheelbase_m: f64) -> Self {
        Self {
            wheelbase_m,
            steering_ratio: 1.0,
            steering_offset_rad: 0.0,
            understeer_s2_per_m2: 0.0,
        }
    }

    /// The same vehicle with a steering wheel's angle as signal: `steering_ratio` times the road wheels' angle.
    #[must_use]
    pub fn with_steering_wheel(self, steering_ratio: f64) -> Self {
        Self {
            steering_ratio,
            ..self
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::Config`], naming the first implausible field.
    pub fn validate(&self) -> Result<()> {
        let check = |ok: bool, field, value: f64, expected| {
            ok.then_some(()).ok_or(Error::Config {
                field,
                value,
                expected,
            })
        };
        let (from, to) = (0.3, 20.0);
        check(
            (from..=to).contains(&self.wheelbase_m),
            "wheelbase_m",
            self.wheelbase_m,
            Expected::Metres { from, to },
        )?;
        // In some cars the signal grows to the right, which a negative ratio expresses.
        let (from, to) = (0.5, 60.0);
        check(
            (from..=to).contains(&self.steering_ratio.abs()),
            "steering_ratio",
            self.steering_ratio,
            Expected::SteeringRatio { from, to },
        )?;
        check(
            self.steering_offset_rad.abs() < 3.2,
            "steering_offset_rad",
            self.steering_offset_rad,
            Expected::Angle,
        )?;
        let (from, to) = (0.0, 0.02);
        check(
            (from..=to).contains(&self.understeer_s2_per_m2),
            "understeer_s2_per_m2",
            self.understeer_s2_per_m2,
            Expected::Understeer { from, to },
        )
    }

    /// Yaw rate in rad/s, positive to the left, for a speed in m/s and a reading of the steering signal in radians. The road wheels' angle
    /// is limited to 1.2 rad: larger readings are wrong, and near the pole of the tangent the yaw rate would grow without limit.
    #[must_use]
    pub fn yaw_rate(&self, speed_mps: f64, steering_rad: f64) -> f64 {
        let delta = (steering_rad - self.steering_offset_rad) / self.steering_ratio;
        let slip = 1.0 + self.understeer_s2_per_m2 * speed_mps * speed_mps;
        speed_mps * delta.clamp(-1.2, 1.2).tan() / (self.wheelbase_m * slip)
    }

    /// θ̇_V over time: at every sample of the steering signal with a known speed, and at every sample of the speed with a known steering
    /// angle. Its integral is θ_V (Eq. 27).
    #[must_use]
    pub fn yaw_rate_signal(&self, speed: &Signal, steering: &Signal) -> Signal {
        let mut times: Vec<f64> = [speed.times_s(), steering.times_s()].concat();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let samples = times.iter().filter_map(|t| {
            let (v, s) = (speed.at(*t)?, steering.at(*t)?);
            Some((*t, self.yaw_rate(v, s)))
        });
        // A gap in either signal is a gap in the product, because samples are missing there. Elsewhere the product's samples are at least
        // as dense as those of the denser signal.
        Signal::with_max_gap(samples, speed.max_gap_s().min(steering.max_gap_s()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    fn constant(value: f64) -> Signal {
        Signal::new((0..=100).map(|i| (f64::from(i) * 0.02, value)))
    }

    #[test]
    fn a_circle_has_the_radius_of_the_geometry() {
        // R = L / tan δ: with δ = atan(2.7 / 10) the rear axle drives a circle of 10 m.
        let bicycle = Bicycle::new(2.7).with_steering_wheel(15.0);
        let steering = constant(15.0 * (0.27_f64).atan());
        let yaw = bicycle.yaw_rate_signal(&constant(5.0), &steering);
        let turned = yaw.integral(0.0, 2.0).unwrap();
        assert!((turned - 1.0).abs() < 1e-12, "{turned}");
    }

    #[test]
    fn the_offset_means_straight_ahead_and_the_sign_can_be_reversed() {
        let mut bicycle = Bicycle::new(2.7).with_steering_wheel(-15.0);
        bicycle.steering_offset_rad = 0.1;
        assert!(bicycle.yaw_rate(20.0, 0.1).abs() < 1e-15);
        assert!(bicycle.yaw_rate(20.0, 0.3) < 0.0);
    }

    #[test]
    fn understeer_turns_less_the_faster_it_goes() {
        let mut bicycle = Bicycle::new(2.5);
        let plain = bicycle.yaw_rate(20.0, 0.02);
        bicycle.understeer_s2_per_m2 = 0.0025;
        assert!((bicycle.yaw_rate(20.0, 0.02) - plain / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_gap_in_either_signal_is_a_gap() {
        let gappy = Signal::new(
            (0..=100)
                .filter(|i| !(40..60).contains(i))
                .map(|i| (f64::from(i) * 0.02, 1.0)),
        );
        for (speed, steering) in [(constant(1.0), gappy.clone()), (gappy, constant(1.0))] {
            let yaw = Bicycle::new(2.7).yaw_rate_signal(&speed, &steering);
            assert!(yaw.integral(0.1, 0.5).is_some());
            assert!(yaw.integral(0.5, 1.5).is_none());
        }
        assert!(
            Bicycle::new(2.7)
                .yaw_rate_signal(&Signal::default(), &constant(1.0))
                .is_empty()
        );
    }

    #[test]
    fn implausible_vehicles_are_refused_by_field() {
        let bad = [
            (Bicycle::new(f64::NAN), "wheelbase_m"),
            (Bicycle::new(0.0), "wheelbase_m"),
            (Bicycle::new(2.7).with_steering_wheel(0.0), "steering_ratio"),
            (
                Bicycle {
                    steering_offset_rad: 40.0,
                    ..Bicycle::new(2.7)
                },
                "steering_offset_rad",
            ),
            (
                Bicycle {
                    understeer_s2_per_m2: -1.0,
                    ..Bicycle::new(2.7)
                },
                "understeer_s2_per_m2",
            ),
        ];
        for (bicycle, field) in bad {
            let error = bicycle.validate().unwrap_err();
            assert!(error.to_string().contains(field), "{error}");
            assert!(error.hint().is_some());
        }
        assert!(Bicycle::new(2.7).validate().is_ok());
        // An absurd reading still gives a finite rate.
        assert!(Bicycle::new(2.7).yaw_rate(10.0, 1e9).is_finite());
    }
}
