//! How well a pair's points agree with a given turn. This decides between offsets of the vehicle's clock.

use super::pitching::USUAL_PITCH;
use super::{EpipolarPair, ROUNDS, along, headed_past, turning};
use nalgebra::{Vector2, Vector3};

impl EpipolarPair {
    /// Sum of the points' robust costs, ½ ln(1 + (residual / noise)²), across their epipolar lines if the camera turned as
    /// the vehicle measured and moved along `direction`, except for a momentary pitch, which is estimated.
    pub(crate) fn cost_of_the_vehicle_s_turn(&self, direction: &Vector3<f64>) -> f64 {
        let omega = self.earlier_from_later.axis_angle();
        // The residual across a line, and what a pitch of one radian would add to it.
        let rows: Vec<(f64, f64)> = self
            .points
            .iter()
            .filter_map(|(at, by)| {
                let along = along(at, direction)?;
                let across = Vector2::new(-along.y, along.x);
                let parallax = by - turning(at) * omega;
                let line_turns = along.x / headed_past(at, direction).norm();
                Some((across.dot(&parallax), along.dot(&parallax) * line_turns))
            })
            .collect();
        let hold = USUAL_PITCH.powi(-2);
        let mut pitch = 0.0;
        for _ in 0..ROUNDS {
            let (mut m, mut y) = (hold, 0.0);
            for (left, row) in &rows {
                let residual = (left - row * pitch) / self.noise;
                let weight = 1.0 / (1.0 + residual * residual) / self.noise.powi(2);
                m += weight * row * row;
                y += weight * left * row;
            }
            pitch = y / m;
        }
        let cost =
            |(left, row): &(f64, f64)| 0.5 * ((left - row * pitch) / self.noise).powi(2).ln_1p();
        rows.iter().map(cost).sum()
    }
}
