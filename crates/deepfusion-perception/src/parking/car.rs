//! A car of a row: a box of typical size, at a right angle to the row.

use super::segments::RowPoint;
use super::{Row, View};
use crate::box_fit::CAR;
use crate::clusters::Cluster;
use crate::outermost::ends;
use crate::{Detection, GroundBox, Run};

/// Range of a car's near end relative to the row's middle, away from the lane, in metres.
const FRONT_M: [f32; 2] = [-3.0, -1.5];
/// Smallest visible share of the length that is assumed: the row gives orientation and position.
const KNOWN: f32 = 0.4;

/// Smallest height of a car, in metres: of some cars only the lower part is visible.
const LOWEST_M: f32 = 1.3;

/// The car at a position along a row, from its points, and whether its front is visible, which determines its position.
pub(super) fn car(
    along: f32,
    points: &[&RowPoint],
    row: &Row,
    view: &View,
) -> Option<(Detection, bool)> {
    let mut alongs: Vec<f32> = points.iter().map(|p| p.along).collect();
    let [first, last] = ends(&mut alongs, 1000)?;
    let away = row.at(along).signum();
    let mut off: Vec<f32> = points.iter().map(|p| away * p.off).collect();
    let [near, far] = ends(&mut off, 20)?;
    let mut heights: Vec<f32> = points.iter().map(|p| p.height).collect();
    let [_, top] = ends(&mut heights, 100)?;
    if top < view.config.min_target_height_m {
        return None;
    }
    let front = (FRONT_M[0]..FRONT_M[1]).contains(&near);
    let behind_front = if front { near + 0.5 * CAR[0] } else { 0.0 };
    let middle = row.place(along, away * behind_front);
    let place = GroundBox {
        middle,
        angle: row.angle(along).rem_euclid(std::f32::consts::PI),
        footprint: CAR,
        heights: [0.0, top.max(LOWEST_M)],
        seen: [
            ((far - near) / CAR[0]).clamp(KNOWN, 1.0),
            ((last - first) / CAR[1]).clamp(0.1, 1.0),
        ],
        anchor: middle,
    };
    let mut pixels: Vec<u32> = points.iter().map(|p| p.pixel).collect();
    pixels.sort_unstable();
    let cluster = cluster(&pixels, view.rays.x.len() as u32);
    let detection = Detection {
        place,
        pixels: cluster.pixels,
        bounds: cluster.bounds(),
        runs: cluster.runs,
        confidence: 0.5 * (place.seen[0] + place.seen[1]),
        relative_error: None,
        kind: None,
    };
    Some((detection, front))
}

/// A cluster of pixels, in their order.
fn cluster(pixels: &[u32], width: u32) -> Cluster {
    let mut runs: Vec<Run> = Vec::new();
    for pixel in pixels {
        let (v, u) = (pixel / width, pixel % width);
        match runs.last_mut() {
            Some(run) if run.v == v && run.to == u => run.to += 1,
            _ => runs.push(Run {
                v,
                from: u,
                to: u + 1,
            }),
        }
    }
    Cluster {
        runs,
        pixels: pixels.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjacent_pixels_are_joined_into_runs() {
        let made = cluster(&[8, 9, 10, 13, 20], 10);
        let runs: Vec<_> = made.runs.iter().map(|r| (r.v, r.from, r.to)).collect();
        assert_eq!(runs, [(0, 8, 10), (1, 0, 1), (1, 3, 4), (2, 0, 1)]);
        assert_eq!(made.pixels, 5);
    }
}
