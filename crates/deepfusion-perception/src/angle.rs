//! The orientation of a box around a contour.

use crate::ground_box::axes;
use crate::lanes::{LANES, Points};

/// Distance within which a point of the contour belongs to a face, in metres.
pub(crate) const FACE: f32 = 0.25;
/// Number of angles of the coarse search, over a quarter of a turn.
const COARSE: usize = 30;
/// Weight of the expected orientation, per point of the contour.
const EXPECTED: f32 = 0.03;

/// The angle at which most of the contour lies on the two faces towards the camera (similar to the closeness criterion of Zhang et al.,
/// "Efficient L-shape fitting for vehicle detection using laser scanners", 2017).
pub(crate) fn best_angle(contour: &[[f32; 2]], along: f32) -> f32 {
    let contour = Points::new(contour.iter().copied());
    let step = std::f32::consts::FRAC_PI_2 / COARSE as f32;
    let score = |angle: f32| {
        // Four times the angle is the same for all sides of a box.
        let prior = EXPECTED * (4.0 * (angle - along)).cos();
        closeness(&contour, axes(angle)) / contour.count.max(1) as f32 + prior
    };
    let best_of = |angles: &mut dyn Iterator<Item = f32>| {
        angles
            .map(|angle| (score(angle), angle))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(along, |(_, angle)| angle)
    };
    // Starting at the expected angle, so that it is one of those tried.
    let coarse = best_of(&mut (0..COARSE).map(|i| along + i as f32 * step));
    best_of(&mut (-4..=4).map(|i| coarse + i as f32 * step / 5.0))
}

/// Number of points on one of the two faces towards the camera; points near a face count in part.
fn closeness(contour: &Points, axes: [[f32; 2]; 2]) -> f32 {
    let near = axes.map(|axis| {
        let [low, high] = contour.extent(axis);
        // The camera is at the origin.
        if low + high >= 0.0 { low } else { high }
    });
    let mut sums = [0.0; LANES];
    for (block, [right, forward]) in contour.blocks.iter().enumerate() {
        // The last lanes may be padding.
        let lanes = contour.count - block * LANES;
        for i in 0..LANES {
            let off = [0, 1].map(|k| right[i] * axes[k][0] + forward[i] * axes[k][1] - near[k]);
            let off = off[0].abs().min(off[1].abs()) / FACE;
            // The weight falls off slowly, because bumpers are round.
            let on_face = 1.0 / (1.0 + off * off);
            sums[i] += if i < lanes { on_face } else { 0.0 };
        }
    }
    sums.iter().sum()
}
