//! Seams between two objects in a cluster's contour: a step back from one object to another behind it, or a border between parts that reach
//! the ceiling and parts that do not.

use crate::clusters::{Cluster, Gaps};
use crate::lanes::Points;
use crate::silhouette::{FOOT_M, Silhouette};
use crate::{Ground, PerceptionConfig, Rays};

/// How far the contour must step back, in addition to a surface's own step, in metres.
const STEP_M: f32 = 0.15;
/// Largest number of points of a part's contour to which a pixel's distance is measured.
const POINTS: usize = 24;
/// Smallest number of columns on each side of a border between tall and low parts.
const COLUMNS: usize = 2;

/// The two sides of a cluster's clearest seam; `None` if it has none.
#[must_use]
pub(crate) fn part_at_seam(
    cluster: &Cluster,
    silhouette: &Silhouette,
    depth: &[f32],
    rays: &Rays,
    ground: &Ground,
    config: &PerceptionConfig,
) -> Option<[Cluster; 2]> {
    let seam = clearest(silhouette, rays, config)?;
    let (left, right) = silhouette.contour.split_at(seam + 1);
    let [left, right] = [left, right].map(some_of);
    cluster.divided(depth, rays, |p| {
        let [x, forward, _] = ground.locate(p);
        right.nearest([x, forward]) < left.nearest([x, forward])
    })
}

/// A subsample of a part of a contour, including the last point.
fn some_of(part: &[[f32; 2]]) -> Points {
    let stride = part.len().div_ceil(POINTS);
    Points::new(part.iter().step_by(stride).chain(part.last()).copied())
}

/// Index of the contour point after which the widest seam lies.
fn clearest(silhouette: &Silhouette, rays: &Rays, config: &PerceptionConfig) -> Option<usize> {
    let gaps = Gaps::of(rays, config);
    let contour = &silhouette.contour;
    let back = |i: usize| (contour[i][1] - contour[i + 1][1]).abs();
    let step = |i: usize| {
        let [a, b] = [contour[i], contour[i + 1]];
        let columns = (silhouette.columns[i + 1] - silhouette.columns[i]) as f32;
        let near = a[1].min(b[1]);
        let side = 0.5 * (a[0] + b[0]);
        let usual = gaps.across(side, near) * columns;
        let shown = silhouette.feet[i].max(silhouette.feet[i + 1]) < FOOT_M;
        // A face seen at a grazing angle steps back at every column, not only at one.
        let beside = [i.checked_sub(1), (i + 2 < contour.len()).then_some(i + 1)];
        let grazing = beside.map(|i| i.map_or(f32::INFINITY, back));
        let more = back(i) - usual.max(1.3 * grazing[0]).max(1.3 * grazing[1]) - STEP_M;
        if shown { more } else { 0.0 }
    };
    let border = |i: usize| {
        let rises = &silhouette.rises;
        let same = |part: &[bool]| part.iter().all(|r| *r == part[0]);
        let reaches = i + 1 >= COLUMNS && i + 1 + COLUMNS <= rises.len();
        reaches
            && rises[i] != rises[i + 1]
            && same(&rises[i + 1 - COLUMNS..=i])
            && same(&rises[i + 1..i + 1 + COLUMNS])
    };
    (0..contour.len().saturating_sub(1))
        .map(|i| (step(i) + f32::from(border(i)), i))
        .filter(|(clear, _)| *clear > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, i)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::Intrinsics;

    /// A contour with one point per column that stands on the ground, tall where `rises` is true.
    fn silhouette(contour: Vec<[f32; 2]>, rises: Vec<bool>) -> Silhouette {
        Silhouette {
            feet: vec![0.3; contour.len()],
            columns: (0..contour.len() as u32).collect(),
            contour,
            rises,
            ..Silhouette::default()
        }
    }

    fn seam(silhouette: &Silhouette) -> Option<usize> {
        let rays = Rays::of(&Intrinsics {
            fx: 370.0,
            fy: 370.0,
            cx: 320.0,
            cy: 96.0,
            width: 640,
            height: 192,
        });
        clearest(silhouette, &rays, &PerceptionConfig::default())
    }

    /// Two fronts along x = -4 with ten columns each, and a gap of 0.8 m between them.
    fn fronts() -> Vec<[f32; 2]> {
        let front = |from: f32| (0..10).map(move |i| [-4.0, from + 0.18 * i as f32]);
        front(10.0).chain(front(12.5)).collect()
    }

    #[test]
    fn two_fronts_are_split_where_one_ends() {
        let mut row = silhouette(fronts(), vec![false; 20]);
        assert_eq!(seam(&row), Some(9));
        // If the lower part is hidden, the step may be a windscreen behind a hood.
        row.feet = vec![0.9; 20];
        assert_eq!(seam(&row), None);
    }

    #[test]
    fn a_side_seen_at_a_grazing_angle_is_no_gap() {
        let side = (0..8).map(|i| [-1.0, 10.0 + 0.9 * i as f32]).collect();
        assert_eq!(seam(&silhouette(side, vec![false; 8])), None);
    }

    #[test]
    fn a_pillar_is_split_from_the_car_beside_it() {
        let flat: Vec<[f32; 2]> = (0..12).map(|i| [0.05 * i as f32, 9.0]).collect();
        let rises: Vec<bool> = (0..12).map(|i| i < 4).collect();
        assert_eq!(seam(&silhouette(flat.clone(), rises)), Some(3));
        // A single column may be wrong.
        let stray: Vec<bool> = (0..12).map(|i| i == 5).collect();
        assert_eq!(seam(&silhouette(flat, stray)), None);
    }
}
