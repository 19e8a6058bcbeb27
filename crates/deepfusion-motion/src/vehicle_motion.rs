//! A piece of a drive: an arc, and how a camera on the vehicle moved thereby (SPEC 3.4).

use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// A piece of an arc that a car drove, seen from its start: x forward, y left, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleMotion {
    /// Distance along the arc, in metres; negative when reversing.
    pub distance_m: f64,
    /// Change of heading, in radians; positive to the left.
    pub yaw_rad: f64,
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

    proptest! {
        /// Two pieces of an arc of constant curvature make the whole.
        #[test]
        fn arcs_join(d in 0.1..5.0f64, yaw in -1.0..1.0f64, part in 0.05..0.95f64) {
            let piece = |f: f64| VehicleMotion { distance_m: d * f, yaw_rad: yaw * f }.vehicle0_from_vehicle1();
            let joined = piece(part) * piece(1.0 - part);
            prop_assert!((joined.translation() - piece(1.0).translation()).norm() < 1e-9);
            prop_assert!((joined.axis_angle() - piece(1.0).axis_angle()).norm() < 1e-9);
        }
    }
}
