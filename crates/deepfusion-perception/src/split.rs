//! Splits a row of parked cars that, seen at a grazing angle, forms one cluster.

use crate::clusters::Cluster;
use crate::silhouette::Silhouette;
use crate::{Ground, GroundBox, Rays};

/// A cluster longer than this, in metres, but as wide and high as a car, counts as several cars.
const LONGEST: f32 = 5.7;
/// Width and height up to which that applies, in metres: a lorry is larger.
const WIDEST: f32 = 2.7;
/// See [`WIDEST`].
const HIGHEST: f32 = 2.4;
/// A cluster wider than this, in metres, and no higher than a car counts as two cars side by side.
const TWO_ABREAST: f32 = 2.3;
/// Length of a piece across, in metres.
const ABREAST_PIECE_M: f32 = 0.2;
/// Length of the shortest car, and of a car with the gap to the next, in metres.
const SHORTEST: f32 = 3.0;
/// See [`SHORTEST`].
const PITCH: f32 = 5.4;
/// Share of the height above which a dip is not a gap.
const LEVEL: f32 = 0.85;
/// Length of a piece of the height profile, in metres.
const PIECE_M: f32 = 0.25;

/// The two parts of a box's cluster; `None` if it is not a row of cars.
#[must_use]
pub(crate) fn split(
    cluster: &Cluster,
    silhouette: &Silhouette,
    place: &GroundBox,
    depth: &[f32],
    rays: &Rays,
    ground: &Ground,
) -> Option<[Cluster; 2]> {
    let [length, width] = [0, 1].map(|i| place.footprint[i] * place.seen[i]);
    if is_high_throughout(silhouette, place) {
        return None;
    }
    let (sin, cos) = place.angle.sin_cos();
    let (axis, cut) = if width > TWO_ABREAST {
        let across = [-sin, cos];
        (across, emptiest(silhouette, across)?)
    } else if length > LONGEST && width < WIDEST {
        let along = [cos, sin];
        (along, best_cut(silhouette, along)?)
    } else {
        return None;
    };
    cluster.divided(depth, rays, |p| dot(axis, ground.locate(p)) > cut)
}

/// Whether almost all of it is higher than a car: a lorry, a wall.
fn is_high_throughout(silhouette: &Silhouette, place: &GroundBox) -> bool {
    if silhouette.top <= HIGHEST {
        return false;
    }
    let (sin, cos) = place.angle.sin_cos();
    let mut tops = std::collections::BTreeMap::new();
    for (p, height) in silhouette.contour.iter().zip(&silhouette.tops) {
        let piece = ((cos * p[0] + sin * p[1]) / PIECE_M).floor() as i32;
        let top = tops.entry(piece).or_insert(0.0f32);
        *top = top.max(*height);
    }
    let high = tops.values().filter(|top| **top > 0.85 * HIGHEST).count();
    4 * high > 3 * tops.len()
}

fn dot(axis: [f32; 2], p: [f32; 3]) -> f32 {
    axis[0] * p[0] + axis[1] * p[1]
}

/// The lateral position with the fewest points, for two cars side by side.
fn emptiest(silhouette: &Silhouette, axis: [f32; 2]) -> Option<f32> {
    let places: Vec<f32> = silhouette.points.iter().map(|p| dot(axis, *p)).collect();
    let from = places.iter().copied().fold(f32::INFINITY, f32::min);
    let to = places.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut counts = vec![0usize; ((to - from) / ABREAST_PIECE_M) as usize + 1];
    for x in &places {
        counts[((x - from) / ABREAST_PIECE_M) as usize] += 1;
    }
    let margin = (0.5 / ABREAST_PIECE_M) as usize;
    (margin..counts.len().saturating_sub(margin))
        .min_by_key(|i| counts[*i])
        .map(|i| from + (i as f32 + 0.5) * ABREAST_PIECE_M)
}

/// The position where the row is lowest, between cars of typical length.
fn best_cut(silhouette: &Silhouette, axis: [f32; 2]) -> Option<f32> {
    let along = |p: &[f32; 2]| p[0] * axis[0] + p[1] * axis[1];
    let columns = silhouette.contour.iter().map(along);
    let places: Vec<(f32, f32)> = columns.zip(silhouette.tops.iter().copied()).collect();
    let from = places.iter().map(|p| p.0).fold(f32::INFINITY, f32::min);
    let to = places.iter().map(|p| p.0).fold(f32::NEG_INFINITY, f32::max);
    let length = to - from;
    let cars = (length / PITCH).round().max(2.0);
    let mut tops = vec![0.0f32; (length / PIECE_M) as usize + 1];
    for (x, height) in &places {
        let top = &mut tops[((x - from) / PIECE_M) as usize];
        *top = top.max(*height);
    }
    let piece = |x: f32| (x / PIECE_M) as usize;
    (piece(SHORTEST)..tops.len().saturating_sub(piece(SHORTEST)))
        .map(|i| {
            let x = (i as f32 + 0.5) * PIECE_M;
            let low = tops[i] / silhouette.top.min(HIGHEST);
            // Distance from the nearest even division.
            let share = x / length * cars;
            let uneven = (share - share.round()).abs() * length / cars;
            (low + 0.15 * uneven, low, from + x)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        // A wall or a hedge is as high there as elsewhere.
        .filter(|(_, low, _)| *low < LEVEL)
        .map(|(_, _, cut)| cut)
}
