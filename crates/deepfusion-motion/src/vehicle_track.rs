//! A vehicle's forward speed and yaw rate over time, and its roll and pitch, measured by one unit.

use crate::vehicle_motion::tilt_between;
use crate::{Signal, VehicleMotion};

/// A vehicle's forward speed and yaw rate over time, and its roll and pitch if known.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleTrack {
    speed_mps: Signal,
    yaw_rate_radps: Signal,
    /// Roll and pitch, if measured.
    tilt_rad: Option<[Signal; 2]>,
    /// Rates of roll and pitch, if only these are known.
    tilt_rates_radps: Option<[Signal; 2]>,
}

impl VehicleTrack {
    /// Longest gap that is interpolated, in seconds: five packets of KITTI's oxts.
    pub const MAX_GAP_S: f64 = 0.5;

    /// A track from samples (time in s, forward speed in m/s, yaw rate in rad/s). A sample that is not finite, or not later than the one
    /// before it, is dropped: recorders repeat packets.
    #[must_use]
    pub fn new(samples: &[(f64, f64, f64)]) -> Self {
        // One bad value drops the sample from both signals, which keeps their times the same.
        let good = || {
            samples
                .iter()
                .filter(|(t, v, w)| t.is_finite() && v.is_finite() && w.is_finite())
        };
        Self {
            speed_mps: Signal::with_max_gap(good().map(|s| (s.0, s.1)), Self::MAX_GAP_S),
            yaw_rate_radps: Signal::with_max_gap(good().map(|s| (s.0, s.2)), Self::MAX_GAP_S),
            tilt_rad: None,
            tilt_rates_radps: None,
        }
    }

    /// The same track with samples of the body's tilt (time in s, roll and pitch in radians, as [`VehicleTrack::tilt`]).
    #[must_use]
    pub fn with_tilt(self, samples: &[(f64, f64, f64)]) -> Self {
        let good = || {
            samples
                .iter()
                .filter(|(t, roll, pitch)| t.is_finite() && roll.is_finite() && pitch.is_finite())
        };
        let roll = Signal::with_max_gap(good().map(|s| (s.0, s.1)), Self::MAX_GAP_S);
        let pitch = Signal::with_max_gap(good().map(|s| (s.0, s.2)), Self::MAX_GAP_S);
        Self {
            tilt_rad: Some([roll, pitch]),
            ..self
        }
    }

    /// The same track without roll and pitch, for samples in which they were not really measured.
    #[must_use]
    pub fn without_tilt(self) -> Self {
        Self {
            tilt_rad: None,
            tilt_rates_radps: None,
            ..self
        }
    }

    /// The same track with samples of the rates of roll and pitch (time in s, then rad/s, axes as [`VehicleTrack::tilt`]). Gaps of up to
    /// `max_gap_s` seconds are interpolated. Where the rates are unknown, the motion is level.
    #[must_use]
    pub fn with_tilt_rates(self, samples: &[(f64, [f64; 2])], max_gap_s: f64) -> Self {
        let rates = |axis: usize| {
            let samples = samples.iter().map(|(time_s, rates)| (*time_s, rates[axis]));
            Signal::with_max_gap(samples, max_gap_s)
        };
        Self {
            tilt_rates_radps: Some([rates(0), rates(1)]),
            ..self
        }
    }

    /// The same track with samples of another yaw rate (time in s, rad/s, positive to the left). Gaps of up to `max_gap_s` seconds are
    /// interpolated.
    #[must_use]
    pub fn with_yaw_rate(self, samples: &[(f64, f64)], max_gap_s: f64) -> Self {
        Self {
            yaw_rate_radps: Signal::with_max_gap(samples.iter().copied(), max_gap_s),
            ..self
        }
    }

    /// Whether roll and pitch, or their rates, are known.
    #[must_use]
    pub fn has_tilt(&self) -> bool {
        self.tilt_rad.is_some() || self.tilt_rates_radps.is_some()
    }

    /// The same track with every speed multiplied by `scale`, the ratio of true to measured speed.
    #[must_use]
    pub fn with_speed_scale(self, scale: f64) -> Self {
        Self {
            speed_mps: self.speed_mps.map(|v| v * scale),
            ..self
        }
    }

    /// Roll (the left side up) and pitch (the nose down) at a time, in radians; `None` if unknown.
    #[must_use]
    pub fn tilt(&self, time_s: f64) -> Option<[f64; 2]> {
        let [roll, pitch] = self.tilt_rad.as_ref()?;
        Some([roll.at(time_s)?, pitch.at(time_s)?])
    }

    /// Times of the samples, in seconds.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        self.speed_mps.times_s()
    }

    /// Forward speed, in m/s.
    #[must_use]
    pub fn speed(&self) -> &Signal {
        &self.speed_mps
    }

    /// Yaw rate, in rad/s, positive to the left.
    #[must_use]
    pub fn yaw_rate(&self) -> &Signal {
        &self.yaw_rate_radps
    }

    /// Forward speed at a time, in m/s, interpolated; `None` if the track does not cover it.
    #[must_use]
    pub fn speed_at(&self, time_s: f64) -> Option<f64> {
        self.speed_mps.at(time_s)
    }

    /// The vehicle's motion from `from_s` to `to_s`: the integrals of speed and yaw rate by the trapezoidal rule over the samples between,
    /// interpolated at both ends. `None` if the track does not cover the interval, or the interval does not run forward.
    #[must_use]
    pub fn motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        if from_s >= to_s {
            return None;
        }
        let yaw_rad = self.yaw_rate_radps.integral(from_s, to_s)?;
        let tilts = self.tilt(from_s).zip(self.tilt(to_s));
        let turned = || {
            let [roll, pitch] = self.tilt_rates_radps.as_ref()?;
            Some([roll.integral(from_s, to_s)?, pitch.integral(from_s, to_s)?])
        };
        let tilt_rad = match tilts {
            Some((from, to)) => tilt_between(from, to, yaw_rad),
            None => turned().unwrap_or_default(),
        };
        Some(VehicleMotion {
            distance_m: self.speed_mps.integral(from_s, to_s)?,
            yaw_rad,
            tilt_rad,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_accelerating_car_goes_half_a_t_squared() {
        // v = 3 t, sampled unevenly: the trapezoidal rule is exact for it.
        let samples: Vec<_> = [0.0, 0.1, 0.25, 0.3, 0.5]
            .iter()
            .map(|t| (*t, 3.0 * t, -0.2))
            .collect();
        let motion = VehicleTrack::new(&samples).motion(0.05, 0.45).unwrap();
        assert!((motion.distance_m - 1.5 * (0.45_f64.powi(2) - 0.05_f64.powi(2))).abs() < 1e-12);
        assert!((motion.yaw_rad + 0.08).abs() < 1e-12);
    }

    #[test]
    fn there_is_no_motion_in_gaps_and_beyond_the_ends() {
        let track = VehicleTrack::new(&[
            (0.0, 5.0, 0.0),
            (0.1, 5.0, 0.0),
            (0.1, 9.0, 0.0),
            (1.0, 5.0, 0.0),
        ]);
        assert_eq!(track.times_s(), [0.0, 0.1, 1.0]);
        assert!(track.motion(0.0, 0.1).is_some());
        assert!(track.motion(0.05, 0.5).is_none(), "across a gap of 0.9 s");
        assert!(
            track.motion(1.0, 1.1).is_some(),
            "just beyond the last sample"
        );
        assert!(track.motion(1.0, 1.3).is_none());
        assert!(track.motion(0.1, 0.0).is_none(), "backwards in time");
        assert!(track.speed_at(-0.1).is_some() && track.speed_at(-0.2).is_none());
        assert!(VehicleTrack::default().speed_at(0.0).is_none());
    }

    #[test]
    fn a_sample_with_an_invalid_value_is_dropped() {
        let track = VehicleTrack::new(&[
            (0.0, 5.0, 0.0),
            (0.1, f64::NAN, 0.0),
            (0.2, 5.0, f64::INFINITY),
            (f64::NAN, 5.0, 0.0),
            (0.3, 5.0, 0.0),
        ]);
        assert_eq!(track.times_s(), [0.0, 0.3]);
        assert!((track.motion(0.0, 0.3).unwrap().distance_m - 1.5).abs() < 1e-12);
    }

    proptest! {
        /// Integrals over neighbouring intervals add up.
        #[test]
        fn integrals_of_adjacent_intervals_add_up(speeds in proptest::collection::vec(0.0..20.0f64, 12), cut in 0.05..1.0f64) {
            let samples: Vec<_> = speeds.iter().enumerate().map(|(i, v)| (i as f64 * 0.1, *v, v * 0.01)).collect();
            let track = VehicleTrack::new(&samples);
            let distance = |a, b| track.motion(a, b).unwrap().distance_m;
            prop_assert!((distance(0.0, cut) + distance(cut, 1.1) - distance(0.0, 1.1)).abs() < 1e-9);
        }
    }
}
