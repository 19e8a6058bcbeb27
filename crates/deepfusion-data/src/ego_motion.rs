//! How the car moved between two times, and how a camera on it moved thereby (SPEC 3).

use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// Longest gap between two samples that is bridged by interpolation, in seconds: five packets of
/// KITTI's oxts. Across a longer one the speed is unknown, not straight.
const MAX_GAP_S: f64 = 0.5;
/// How far beyond its first or last sample a track is taken as constant, in seconds: camera and oxts
/// clocks of one frame differ by some milliseconds either way.
const MAX_OVERHANG_S: f64 = 0.15;

/// A car's forward speed and yaw rate over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleTrack {
    time_s: Vec<f64>,
    speed_mps: Vec<f64>,
    yaw_rate_radps: Vec<f64>,
}

/// A piece of an arc that a car drove, seen from its start: x forward, y left, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleMotion {
    /// Distance along the arc, in metres; negative when reversing.
    pub distance_m: f64,
    /// Change of heading, in radians; positive to the left.
    pub yaw_rad: f64,
}

impl VehicleTrack {
    /// A track of samples (time in s, forward speed in m/s, yaw rate in rad/s). A sample that is not
    /// later than the one before it is dropped: recorders repeat packets.
    #[must_use]
    pub fn new(samples: &[(f64, f64, f64)]) -> Self {
        let mut track = Self::default();
        for &(time_s, speed_mps, yaw_rate_radps) in samples {
            if track.time_s.last().is_none_or(|last| time_s > *last) {
                track.time_s.push(time_s);
                track.speed_mps.push(speed_mps);
                track.yaw_rate_radps.push(yaw_rate_radps);
            }
        }
        track
    }

    /// Times of the samples, in seconds.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Forward speed at a time, in m/s, between its neighbours; `None` where the track does not cover it.
    #[must_use]
    pub fn speed_at(&self, time_s: f64) -> Option<f64> {
        self.covers(time_s, time_s)
            .then(|| self.interpolate(&self.speed_mps, time_s))
    }

    /// What the car did from `from_s` to `to_s`: the integrals of speed and yaw rate by the trapezoidal
    /// rule over the samples between, and interpolated at both ends. `None` where the track does not
    /// cover the time, or it does not run forward.
    #[must_use]
    pub fn motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        (from_s < to_s && self.covers(from_s, to_s)).then(|| VehicleMotion {
            distance_m: self.integrate(&self.speed_mps, from_s, to_s),
            yaw_rad: self.integrate(&self.yaw_rate_radps, from_s, to_s),
        })
    }

    fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let (Some(first), Some(last)) = (self.time_s.first(), self.time_s.last()) else {
            return false;
        };
        if from_s < first - MAX_OVERHANG_S || to_s > last + MAX_OVERHANG_S {
            return false;
        }
        // The samples from the last one not after the start to the first one not before the end.
        let begin = self.time_s.partition_point(|t| *t <= from_s).max(1) - 1;
        let end = self.time_s.partition_point(|t| *t < to_s) + 1;
        let around = &self.time_s[begin..end.min(self.time_s.len())];
        around.windows(2).all(|pair| pair[1] - pair[0] <= MAX_GAP_S)
    }

    fn interpolate(&self, values: &[f64], time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|t| *t < time_s);
        if after == 0 {
            return values[0];
        }
        if after == values.len() {
            return values[after - 1];
        }
        let (t0, t1) = (self.time_s[after - 1], self.time_s[after]);
        let fraction = (time_s - t0) / (t1 - t0);
        values[after - 1] + (values[after] - values[after - 1]) * fraction
    }

    fn integrate(&self, values: &[f64], from_s: f64, to_s: f64) -> f64 {
        let inner = self.time_s.partition_point(|t| *t <= from_s)
            ..self.time_s.partition_point(|t| *t < to_s);
        let (mut time, mut value) = (from_s, self.interpolate(values, from_s));
        let mut sum = 0.0;
        for i in inner {
            sum += 0.5 * (value + values[i]) * (self.time_s[i] - time);
            (time, value) = (self.time_s[i], values[i]);
        }
        sum + 0.5 * (value + self.interpolate(values, to_s)) * (to_s - time)
    }
}

impl VehicleMotion {
    /// `vehicle0_from_vehicle1`: the car's frame at the end seen from its frame at the start, along
    /// the arc Δ = d·sinc(θ/2)·(cos θ/2, sin θ/2, 0) with heading θ (SPEC 3.4).
    #[must_use]
    pub fn vehicle0_from_vehicle1(&self) -> Se3 {
        let half = 0.5 * self.yaw_rad;
        // Two terms of the series are exact to the last bit here.
        let sinc = if half.abs() < 1e-4 {
            1.0 - half * half / 6.0
        } else {
            half.sin() / half
        };
        let chord = self.distance_m * sinc;
        Se3::from_axis_angle(
            Vector3::new(0.0, 0.0, self.yaw_rad),
            Vector3::new(chord * half.cos(), chord * half.sin(), 0.0),
        )
    }

    /// `camera0_from_camera1` of a camera fixed to the car: the rigid body's motion at the camera's
    /// place, lever arm included.
    #[must_use]
    pub fn camera0_from_camera1(&self, cam_from_vehicle: &Se3) -> Se3 {
        *cam_from_vehicle * self.vehicle0_from_vehicle1() * cam_from_vehicle.inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    /// A camera `forward` metres before and `up` above the vehicle's origin, looking ahead.
    fn cam_from_vehicle(forward: f64, up: f64) -> Se3 {
        let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        Se3::from_parts(&axes, -(axes * Vector3::new(forward, 0.0, up)))
    }

    #[test]
    fn driving_ahead_brings_the_world_nearer() {
        let motion = VehicleMotion {
            distance_m: 2.0,
            yaw_rad: 0.0,
        };
        let frame1_from_frame0 = motion
            .camera0_from_camera1(&cam_from_vehicle(1.0, 0.5))
            .inverse();
        let nearer = frame1_from_frame0.transform(&Vector3::new(0.0, 0.0, 10.0));
        assert!(
            (nearer - Vector3::new(0.0, 0.0, 8.0)).norm() < 1e-12,
            "{nearer}"
        );
    }

    #[test]
    fn a_camera_ahead_of_the_axle_swings_out_in_a_turn() {
        // Turning left on the spot by 0.1 rad: a camera 2 m ahead moves 0.2 m to its left (x < 0).
        let motion = VehicleMotion {
            distance_m: 0.0,
            yaw_rad: 0.1,
        };
        let moved = motion
            .camera0_from_camera1(&cam_from_vehicle(2.0, 0.0))
            .translation();
        assert!((moved.x + 2.0 * 0.1_f64.sin()).abs() < 1e-12, "{moved}");
        assert!(
            (moved.norm() - 4.0 * 0.05_f64.sin()).abs() < 1e-12,
            "{moved}"
        );
    }

    #[test]
    fn an_accelerating_car_goes_half_a_t_squared() {
        // v = 3 t sampled unevenly: the trapezoidal rule is exact for it.
        let samples: Vec<_> = [0.0, 0.1, 0.25, 0.3, 0.5]
            .iter()
            .map(|t| (*t, 3.0 * t, -0.2))
            .collect();
        let motion = VehicleTrack::new(&samples).motion(0.05, 0.45).unwrap();
        assert!((motion.distance_m - 1.5 * (0.45_f64.powi(2) - 0.05_f64.powi(2))).abs() < 1e-12);
        assert!((motion.yaw_rad + 0.08).abs() < 1e-12);
    }

    #[test]
    fn gaps_and_ends_are_not_made_up() {
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

    proptest! {
        /// Two pieces of an arc of constant curvature make the whole.
        #[test]
        fn arcs_join(d in 0.1..5.0f64, yaw in -1.0..1.0f64, part in 0.05..0.95f64) {
            let piece = |f: f64| VehicleMotion { distance_m: d * f, yaw_rad: yaw * f }.vehicle0_from_vehicle1();
            let joined = piece(part) * piece(1.0 - part);
            prop_assert!((joined.translation() - piece(1.0).translation()).norm() < 1e-9);
            prop_assert!((joined.axis_angle() - piece(1.0).axis_angle()).norm() < 1e-9);
        }

        /// Integrals over neighbouring intervals add up.
        #[test]
        fn integrals_join(speeds in proptest::collection::vec(0.0..20.0f64, 12), cut in 0.05..1.0f64) {
            let samples: Vec<_> = speeds.iter().enumerate().map(|(i, v)| (i as f64 * 0.1, *v, v * 0.01)).collect();
            let track = VehicleTrack::new(&samples);
            let distance = |a, b| track.motion(a, b).unwrap().distance_m;
            prop_assert!((distance(0.0, cut) + distance(cut, 1.1) - distance(0.0, 1.1)).abs() < 1e-9);
        }
    }
}
