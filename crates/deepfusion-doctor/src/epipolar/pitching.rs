//! How a camera turned while its vehicle pitched.
//!
//! A car that pitches by δ heads δ off the direction that the mount gives. Near points, which move far, then leave their epipolar
//! lines as if the camera turned: a part of the angle δ is added to its rate, and the measured oscillation is late, by up to 50 ms.
//! So δ is estimated with the turn. With a from the point headed for to a point, it turns that point's epipolar line by
//! δ·a.x/|a|, and the movement along the line shows across it in the same proportion.

use super::{EpipolarPair, ROUNDS, USUAL_TILT, along, headed_past, turning};
use nalgebra::{Matrix4, Vector2, Vector3, Vector4};

/// Usual pitch of a car, radians.
pub(super) const USUAL_PITCH: f64 = 0.02;

impl EpipolarPair {
    /// The camera's turn according to its points, radians about its axes, if it moved along `direction` except for a momentary pitch.
    /// `None` if they do not determine one.
    pub(crate) fn turn_of_a_pitching_body(&self, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let measured = self.earlier_from_later.axis_angle();
        let [tilt, pitch] = [USUAL_TILT, USUAL_PITCH].map(|usual| 1.0 / usual.powi(2));
        let hold = Vector4::new(tilt, 0.0, tilt, pitch);
        let start = measured.push(0.0);
        let mut found = start;
        // The movement along a line is what remains without the turn, so each round depends on the one before.
        for _ in 0..2 * ROUNDS {
            let mut m = Matrix4::from_diagonal(&hold);
            let mut y = hold.component_mul(&start);
            for (at, by) in &self.points {
                let Some(along) = along(at, direction) else {
                    continue;
                };
                let across = Vector2::new(-along.y, along.x);
                let turning = turning(at);
                let parallax = along.dot(&(by - turning * found.xyz()));
                let line_turns = along.x / headed_past(at, direction).norm();
                let row = (turning.transpose() * across).push(parallax * line_turns);
                let moved = across.dot(by);
                let residual = (moved - row.dot(&found)) / self.noise;
                let weight = 1.0 / (1.0 + residual * residual) / self.noise.powi(2);
                m += weight * row * row.transpose();
                y += weight * moved * row;
            }
            found = m.try_inverse()? * y;
        }
        Some(found.xyz())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::pair;
    use super::super::turned;
    use super::*;
    use deepfusion_geometry::Se3;

    #[test]
    fn the_turn_is_right_at_any_pitch() {
        let omega = Vector3::new(0.003, 0.02, -0.002);
        let measured = Se3::from_axis_angle(Vector3::zeros(), Vector3::z());
        for pitch in [-0.02, 0.0, 0.02] {
            let heads = turned(&Vector3::z(), Vector2::new(pitch, 0.0));
            let pair = pair(heads, omega, measured);
            let turn = pair.turn_of_a_pitching_body(&Vector3::z()).unwrap();
            // A fixed heading would be off by the pitch over some 14 m: 0.0014.
            assert!((turn - omega).norm() < 5e-4, "{pitch} {turn}");
        }
    }
}
