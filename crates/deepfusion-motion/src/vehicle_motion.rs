//! The vehicle's motion over a short time as an arc, and the camera's motion that follows from it (docs/concepts/ego-motion.md).

use deepfusion_geometry::Se3;
use nalgebra::{Rotation3, Vector3};

/// A vehicle's motion along an arc, in the vehicle frame at its start: x forward, y left, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleMotion {
    /// Distance along the arc, in metres; negative when reversing.
    pub distance_m: f64,
    /// Change of heading, in radians; positive to the left.
    pub yaw_rad: f64,
    /// Roll and pitch of the body at the end relative to its start, after the yaw, in radians: roll (about x, the left side up) and pitch
    /// (about y, the nose down), as Rz(yaw)·Ry(pitch)·Rx(roll). Zero if not measured.
    pub tilt_rad: [f64; 2],
}

impl VehicleMotion {
    /// `vehicle0_from_vehicle1`: the car's frame at the end seen from its frame at the start, along
    /// the arc Δ = d·sinc(θ/2)·(cos θ/2, sin θ/2, 0) with heading θ.
    #[must_use]
    pub fn vehicle0_from_vehicle1(&self) -> Se3 {
        let half = 0.5 * self.yaw_rad;
        // Here two terms of the series are accurate to the last bit.
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

    /// The same motion without roll and pitch.
    #[must_use]
    pub fn level(self) -> Self {
        Self {
            tilt_rad: [0.0; 2],
            ..self
        }
    }

    /// `camera0_from_camera1` of a camera fixed to the car: the rigid body's motion along the arc at the camera's position, including the
    /// lever arm, and the body's roll and pitch. The axes of roll and pitch are unknown (the body hangs on springs, between the axles), so
    /// they rotate the camera without moving it.
    #[must_use]
    pub fn camera0_from_camera1(&self, cam_from_vehicle: &Se3) -> Se3 {
        let level = *cam_from_vehicle * self.vehicle0_from_vehicle1() * cam_from_vehicle.inverse();
        let [roll, pitch] = self.tilt_rad;
        let tilt = Rotation3::from_euler_angles(roll, pitch, 0.0).scaled_axis();
        level * Se3::from_axis_angle(cam_from_vehicle.rotate(&tilt), Vector3::zeros())
    }
}

/// [`VehicleMotion::tilt_rad`] from roll and pitch relative to the vertical at the start and at the end, in radians: the rotation
/// T₀ᵀ·Rz(θ)·T₁ without its yaw.
pub(crate) fn tilt_between(from: [f64; 2], to: [f64; 2], yaw_rad: f64) -> [f64; 2] {
    let [from, to] = [from, to].map(|[roll, pitch]| Rotation3::from_euler_angles(roll, pitch, 0.0));
    let turn = Rotation3::from_euler_angles(0.0, 0.0, yaw_rad);
    let (roll, pitch, _) = (from.inverse() * turn * to).euler_angles();
    [roll, pitch]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    /// A camera `forward` metres ahead of and `up` metres above the vehicle's origin, looking ahead.
    fn cam_from_vehicle(forward: f64, up: f64) -> Se3 {
        let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        Se3::from_parts(&axes, -(axes * Vector3::new(forward, 0.0, up)))
    }

    #[test]
    fn driving_ahead_brings_the_world_nearer() {
        let motion = VehicleMotion {
            distance_m: 2.0,
            yaw_rad: 0.0,
            tilt_rad: [0.0; 2],
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
            tilt_rad: [0.0; 2],
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
    fn pitching_down_rotates_the_camera_without_moving_it() {
        let motion = VehicleMotion {
            distance_m: 2.0,
            yaw_rad: 0.1,
            tilt_rad: [0.02, 0.03],
        };
        let mount = cam_from_vehicle(1.5, 1.2);
        let (tilted, level) = [motion, motion.level()]
            .map(|m| m.camera0_from_camera1(&mount))
            .into();
        assert!((tilted.translation() - level.translation()).norm() < 1e-12);
        // The camera's y points down: when it looks down, its axis moves to +y; Rz(yaw)·Ry(pitch) maps x to z = −sin(pitch).
        let axis = tilted.rotate(&Vector3::z());
        assert!((axis.y - 0.03_f64.sin()).abs() < 1e-12, "{axis}");
        // The left side up: the camera's x (right) dips, by cos(pitch)·sin(roll).
        let right = tilted.rotate(&Vector3::x());
        assert!(
            (right.y - 0.03_f64.cos() * 0.02_f64.sin()).abs() < 1e-12,
            "{right}"
        );
    }

    proptest! {
        /// Two pieces of an arc of constant curvature compose to the whole arc.
        #[test]
        fn consecutive_arcs_compose(d in 0.1..5.0f64, yaw in -1.0..1.0f64, part in 0.05..0.95f64) {
            let piece = |f: f64| VehicleMotion { distance_m: d * f, yaw_rad: yaw * f, tilt_rad: [0.0; 2] }.vehicle0_from_vehicle1();
            let joined = piece(part) * piece(1.0 - part);
            prop_assert!((joined.translation() - piece(1.0).translation()).norm() < 1e-9);
            prop_assert!((joined.axis_angle() - piece(1.0).axis_angle()).norm() < 1e-9);
        }
    }
}
