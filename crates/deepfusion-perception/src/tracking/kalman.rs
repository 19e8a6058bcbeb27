use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};

/// Typical acceleration of a target, m/s²: a car that brakes gently.
const ACCELERATION: f64 = 1.5;
/// Standard deviation of the speed of a new target, m/s.
const UNKNOWN_SPEED: f64 = 8.0;

/// A constant-velocity Kalman filter on the ground, in the world's horizontal axes, metres and m/s.
#[derive(Debug, Clone)]
pub(super) struct Kalman {
    /// x, z, and their velocities.
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl Kalman {
    /// A filter at a measured position with its covariance, with unknown velocity.
    pub(super) fn new(place: Vector2<f64>, noise: &Matrix2<f64>) -> Self {
        let mut covariance = Matrix4::identity() * UNKNOWN_SPEED.powi(2);
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(noise);
        Self {
            state: Vector4::new(place.x, place.y, 0.0, 0.0),
            covariance,
        }
    }

    /// Predicts `dt` seconds ahead.
    pub(super) fn predict(&mut self, dt: f64) {
        let mut step = Matrix4::identity();
        step[(0, 2)] = dt;
        step[(1, 3)] = dt;
        let q = ACCELERATION.powi(2);
        let mut noise = Matrix4::zeros();
        for i in 0..2 {
            noise[(i, i)] = 0.25 * dt.powi(4) * q;
            noise[(i, i + 2)] = 0.5 * dt.powi(3) * q;
            noise[(i + 2, i)] = 0.5 * dt.powi(3) * q;
            noise[(i + 2, i + 2)] = dt.powi(2) * q;
        }
        self.state = step * self.state;
        self.covariance = step * self.covariance * step.transpose() + noise;
    }

    /// Updates with a measured position and its covariance.
    pub(super) fn update(&mut self, place: Vector2<f64>, noise: &Matrix2<f64>) {
        let observe = Matrix2x4::identity();
        let Some(inverse) = self.innovation(noise).try_inverse() else {
            return;
        };
        let gain = self.covariance * observe.transpose() * inverse;
        self.state += gain * (place - self.place());
        self.covariance = (Matrix4::identity() - gain * observe) * self.covariance;
        // Rounding must not make it asymmetric over thousands of frames.
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
    }

    /// Squared Mahalanobis distance of a measured position.
    pub(super) fn distance2(&self, place: Vector2<f64>, noise: &Matrix2<f64>) -> f64 {
        let off = place - self.place();
        self.innovation(noise)
            .try_inverse()
            .map_or(f64::INFINITY, |inverse| {
                (off.transpose() * inverse * off)[0]
            })
    }

    fn innovation(&self, noise: &Matrix2<f64>) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0) + noise
    }

    /// The position.
    pub(super) fn place(&self) -> Vector2<f64> {
        self.state.fixed_rows::<2>(0).into()
    }

    /// The velocity.
    pub(super) fn velocity(&self) -> Vector2<f64> {
        self.state.fixed_rows::<2>(2).into()
    }

    /// Standard deviation of its speed along its direction of motion, m/s.
    pub(super) fn speed_deviation(&self) -> f64 {
        let v = self.velocity();
        let direction = v.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let part = self.covariance.fixed_view::<2, 2>(2, 2);
        (direction.transpose() * part * direction)[0]
            .max(0.0)
            .sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_velocity_is_found_within_its_uncertainty() {
        let noise = Matrix2::identity() * 0.04;
        let truth = Vector2::new(-3.0, 9.0);
        let at = |i: i32| Vector2::new(2.0, 20.0) + truth * 0.1 * f64::from(i);
        // A fixed pattern of errors about as large as the assumed noise.
        let error =
            |i: i32| Vector2::new((f64::from(i) * 2.1).sin(), (f64::from(i) * 1.3).cos()) * 0.2;
        let mut filter = Kalman::new(at(0) + error(0), &noise);
        for i in 1..=10 {
            filter.predict(0.1);
            filter.update(at(i) + error(i), &noise);
        }
        let off = (filter.velocity() - truth).norm();
        assert!(off < 0.6, "{off}");
        assert!(
            off < 3.0 * filter.speed_deviation(),
            "{}",
            filter.speed_deviation()
        );
        assert!((filter.place() - at(10)).norm() < 0.2);
    }

    #[test]
    fn uncertainty_grows_without_measurements() {
        let noise = Matrix2::identity() * 0.01;
        let mut filter = Kalman::new(Vector2::zeros(), &noise);
        let far = Vector2::new(1.0, 0.0);
        let before = filter.distance2(far, &noise);
        filter.predict(1.0);
        assert!(filter.distance2(far, &noise) < before);
    }
}
