use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3};

/// A rigid motion. Values are named `a_from_b`: [`Se3::transform`] takes a point of frame b to frame a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se3(Isometry3<f64>);

impl Se3 {
    /// The identity motion.
    #[must_use]
    pub fn identity() -> Self {
        Self(Isometry3::identity())
    }

    /// Makes a motion from a rotation matrix and a translation in metres. The matrix is projected onto the nearest rotation, because
    /// calibration files have six decimals and are not exactly orthonormal.
    #[must_use]
    pub fn from_parts(rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Self {
        let rotation = Rotation3::from_matrix_eps(rotation, 1e-15, 100, Rotation3::identity());
        Self(Isometry3::from_parts(
            Translation3::from(translation),
            UnitQuaternion::from_rotation_matrix(&rotation),
        ))
    }

    /// Converts the axes of a body or a scanner (x forward, y left, z up) to a camera's (x right, y down, z forward) at the same position.
    #[must_use]
    pub fn cam_from_body_axes() -> Self {
        let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        Self::from_parts(&axes, Vector3::zeros())
    }

    /// Makes a motion from an axis-angle vector (radians) and a translation (metres).
    #[must_use]
    pub fn from_axis_angle(axis_angle: Vector3<f64>, translation: Vector3<f64>) -> Self {
        Self(Isometry3::new(translation, axis_angle))
    }

    /// Makes a motion from a quaternion `[w, x, y, z]` (any norm, normalised here) and a translation (metres).
    #[must_use]
    pub fn from_quaternion(wxyz: [f64; 4], translation: Vector3<f64>) -> Self {
        let q = nalgebra::Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
        Self(Isometry3::from_parts(
            Translation3::from(translation),
            UnitQuaternion::from_quaternion(q),
        ))
    }

    /// The rotation as a unit quaternion `[w, x, y, z]`.
    #[must_use]
    pub fn quaternion(&self) -> [f64; 4] {
        let q = self.0.rotation.quaternion();
        [q.w, q.i, q.j, q.k]
    }

    /// The exponential map from a twist (rotational part ω, translational part v) to a motion, t = V(ω)·v.
    #[must_use]
    pub fn exp(omega: Vector3<f64>, v: Vector3<f64>) -> Self {
        let theta2 = omega.norm_squared();
        let theta = theta2.sqrt();
        let w = omega.cross_matrix();
        // Series near zero, where the quotients lose all precision.
        let (a, b) = if theta < 1e-5 {
            (0.5 - theta2 / 24.0, 1.0 / 6.0 - theta2 / 120.0)
        } else {
            (
                (1.0 - theta.cos()) / theta2,
                (theta - theta.sin()) / (theta2 * theta),
            )
        };
        let left_jacobian = Matrix3::identity() + w * a + w * w * b;
        Self::from_axis_angle(omega, left_jacobian * v)
    }

    /// The logarithm map, the inverse of [`Se3::exp`] for rotations below π: (ω, v).
    #[must_use]
    pub fn log(&self) -> (Vector3<f64>, Vector3<f64>) {
        let omega = self.axis_angle();
        let theta2 = omega.norm_squared();
        let theta = theta2.sqrt();
        let w = omega.cross_matrix();
        let c = if theta < 1e-4 {
            1.0 / 12.0 + theta2 / 720.0
        } else {
            (1.0 - theta * theta.sin() / (2.0 * (1.0 - theta.cos()))) / theta2
        };
        let inverse_jacobian = Matrix3::identity() - w * 0.5 + w * w * c;
        (omega, inverse_jacobian * self.translation())
    }

    /// The inverse motion: `a_from_b` to `b_from_a`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self(self.0.inverse())
    }

    /// Transforms a point from frame b to frame a.
    #[must_use]
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.0.rotation * point + self.0.translation.vector
    }

    /// Transforms a direction from frame b to frame a: rotated, not translated.
    #[must_use]
    pub fn rotate(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.0.rotation * direction
    }

    /// The translation, in metres.
    #[must_use]
    pub fn translation(&self) -> Vector3<f64> {
        self.0.translation.vector
    }

    /// The rotation as a matrix.
    #[must_use]
    pub fn rotation(&self) -> Matrix3<f64> {
        *self.0.rotation.to_rotation_matrix().matrix()
    }

    /// The rotation as an axis-angle vector, in radians.
    #[must_use]
    pub fn axis_angle(&self) -> Vector3<f64> {
        self.0.rotation.scaled_axis()
    }

    /// The rotation's angle, in radians, in [0, π].
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.0.rotation.angle()
    }

    /// The 4×4 homogeneous matrix.
    #[must_use]
    pub fn matrix(&self) -> Matrix4<f64> {
        self.0.to_homogeneous()
    }

    /// The motion mirrored left to right in the camera frame (x → −x).
    #[must_use]
    pub fn mirrored_x(&self) -> Self {
        let m = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
        Self::from_parts(&(m * self.rotation() * m), m * self.translation())
    }

    /// Interpolates between two motions: `fraction` 0 is `self`, 1 is `other`; rotation by slerp.
    #[must_use]
    pub fn interpolate(&self, other: &Self, fraction: f64) -> Self {
        Self(Isometry3::from_parts(
            Translation3::from(self.translation().lerp(&other.translation(), fraction)),
            self.0
                .rotation
                .try_slerp(&other.0.rotation, fraction, 1e-12)
                .unwrap_or(self.0.rotation),
        ))
    }
}

impl std::ops::Mul for Se3 {
    type Output = Self;

    /// `a_from_b * b_from_c` is `a_from_c`.
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        (-limit..limit, -limit..limit, -limit..limit).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn log_inverts_exp(omega in vector(1.7), v in vector(30.0)) {
            let (o, w) = Se3::exp(omega, v).log();
            prop_assert!((o - omega).norm() < 1e-9, "{o} {omega}");
            prop_assert!((w - v).norm() < 1e-7, "{w} {v}");
        }

        #[test]
        fn log_inverts_exp_near_zero(omega in vector(1e-5), v in vector(1.0)) {
            let (o, w) = Se3::exp(omega, v).log();
            prop_assert!((o - omega).norm() < 1e-12);
            prop_assert!((w - v).norm() < 1e-9);
        }

        #[test]
        fn a_motion_and_its_inverse_cancel(omega in vector(1.5), t in vector(30.0), p in vector(50.0)) {
            let a_from_b = Se3::from_axis_angle(omega, t);
            prop_assert!((a_from_b.inverse().transform(&a_from_b.transform(&p)) - p).norm() < 1e-9);
        }

        #[test]
        fn composition_is_application_in_turn(o1 in vector(1.5), o2 in vector(1.5), t in vector(9.0), p in vector(9.0)) {
            let a_from_b = Se3::from_axis_angle(o1, t);
            let b_from_c = Se3::from_axis_angle(o2, -t);
            let direct = (a_from_b * b_from_c).transform(&p);
            prop_assert!((direct - a_from_b.transform(&b_from_c.transform(&p))).norm() < 1e-9);
        }

        #[test]
        fn a_mirrored_motion_moves_mirrored_points(o in vector(1.5), t in vector(9.0), p in vector(9.0)) {
            let mirror = |v: Vector3<f64>| Vector3::new(-v.x, v.y, v.z);
            let a_from_b = Se3::from_axis_angle(o, t);
            let seen = a_from_b.mirrored_x().transform(&mirror(p));
            prop_assert!((seen - mirror(a_from_b.transform(&p))).norm() < 1e-9);
        }
    }

    #[test]
    fn ahead_of_the_body_is_ahead_of_the_camera() {
        let seen = Se3::cam_from_body_axes().transform(&Vector3::new(5.0, 2.0, 1.0));
        assert!((seen - Vector3::new(-2.0, -1.0, 5.0)).norm() < 1e-12);
    }

    /// The exponential of a constant twist is the limit of many small steps along it.
    #[test]
    fn exp_follows_the_screw() {
        let (omega, v) = (Vector3::new(0.1, -0.4, 0.2), Vector3::new(1.0, 0.3, -0.2));
        let n = 20_000;
        let step = Se3::from_axis_angle(omega / f64::from(n), v / f64::from(n));
        let walked = (0..n).fold(Se3::identity(), |pose, _| pose * step);
        let direct = Se3::exp(omega, v);
        assert!((walked.translation() - direct.translation()).norm() < 1e-4);
        assert!((walked.axis_angle() - direct.axis_angle()).norm() < 1e-9);
    }
}
