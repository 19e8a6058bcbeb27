//! Joins corners to a grid, from each corner to its neighbours, step by step, so that any lens distortion is allowed.

use crate::corners::{Corner, between};
use nalgebra::Vector2;
use std::collections::{HashMap, HashSet, VecDeque};

/// Greatest distance of a corner from the position that its neighbour predicts, as a share of a step.
const REACH: f64 = 0.35;
/// Greatest turn of the edges from one corner to the next, in radians.
const TURN: f64 = 0.45;
/// Greatest angle between an edge of a seed and the direction to its neighbour, in radians.
const ASIDE: f64 = 0.35;
/// Greatest number of corners that a grid is started from.
const SEEDS: usize = 60;

/// For each position of the grid (column, row) the index of its corner.
pub(crate) type Grid = HashMap<(i32, i32), usize>;

/// The largest grid among the corners, of at least nine. The search stops at a grid of `enough` corners.
pub(crate) fn grow(corners: &[Corner], enough: usize) -> Option<Grid> {
    let mut best: Option<Grid> = None;
    let mut seen = HashSet::new();
    for seed in 0..corners.len().min(SEEDS) {
        if seen.contains(&seed) {
            continue;
        }
        let Some(grid) = grow_from(corners, seed) else {
            continue;
        };
        seen.extend(grid.values().copied());
        if best.as_ref().is_none_or(|b| b.len() < grid.len()) {
            best = Some(grid);
        }
        if best.as_ref().is_some_and(|b| b.len() >= enough) {
            break;
        }
    }
    best.filter(|grid| grid.len() >= 9)
}

/// A corner of the grid, with the steps to its right and lower neighbours as measured nearby.
struct GridCorner {
    corner: usize,
    steps: [Vector2<f64>; 2],
}

fn grow_from(corners: &[Corner], seed: usize) -> Option<Grid> {
    let first = &corners[seed];
    let steps = [0, 1].map(|side| seed_step(corners, first, side));
    let [Some(right), Some(down)] = steps else {
        return None;
    };
    let mut placed: HashMap<(i32, i32), GridCorner> = HashMap::new();
    let start = GridCorner {
        corner: seed,
        steps: [right, down],
    };
    placed.insert((0, 0), start);
    let mut used = HashSet::from([seed]);
    let mut queue = VecDeque::from([(0, 0)]);
    while let Some(place) = queue.pop_front() {
        for (side, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let next = moved(place, side, sign);
            if placed.contains_key(&next) {
                continue;
            }
            let Some(from) = placed.get(&place) else {
                continue;
            };
            let corner = &corners[from.corner];
            let mut steps = from.steps;
            let step = steps[side] * f64::from(sign);
            let towards = corner.at + step;
            let near = |i: &usize| (corners[*i].at - towards).norm() <= REACH * step.norm();
            let found = (0..corners.len())
                .filter(|i| !used.contains(i) && near(i) && alternates(corner, &corners[*i]))
                .min_by(|a, b| {
                    let off = |i: usize| (corners[i].at - towards).norm_squared();
                    off(*a).total_cmp(&off(*b))
                });
            if let Some(found) = found {
                steps[side] = (corners[found].at - corner.at) * f64::from(sign);
                used.insert(found);
                let corner = found;
                placed.insert(next, GridCorner { corner, steps });
                queue.push_back(next);
            }
        }
    }
    Some(placed.into_iter().map(|(at, p)| (at, p.corner)).collect())
}

fn moved((column, row): (i32, i32), side: usize, sign: i32) -> (i32, i32) {
    if side == 0 {
        (column + sign, row)
    } else {
        (column, row + sign)
    }
}

/// Along an edge, dark and bright swap sides at every corner: the first edge of one is the second of the next.
fn alternates(a: &Corner, b: &Corner) -> bool {
    between(a.edges[0], b.edges[1]) < TURN && between(a.edges[1], b.edges[0]) < TURN
}

/// The step to the nearest neighbour in the direction of an edge.
fn seed_step(corners: &[Corner], seed: &Corner, side: usize) -> Option<Vector2<f64>> {
    let (sin, cos) = seed.edges[side].sin_cos();
    let direction = Vector2::new(cos, sin);
    let steps = corners
        .iter()
        .filter(|c| alternates(seed, c))
        .map(|c| c.at - seed.at);
    steps
        .filter(|step| {
            let length = step.norm();
            length > 3.0 && step.dot(&direction) / length > ASIDE.cos()
        })
        .min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
}

/// First position, columns and rows of the smallest rectangle around the grid.
pub(crate) fn extent(grid: &Grid) -> ((i32, i32), usize, usize) {
    let columns = grid.keys().map(|p| p.0);
    let rows = grid.keys().map(|p| p.1);
    let (c0, c1) = (
        columns.clone().min().unwrap_or(0),
        columns.max().unwrap_or(0),
    );
    let (r0, r1) = (rows.clone().min().unwrap_or(0), rows.max().unwrap_or(0));
    ((c0, r0), (c1 - c0 + 1) as usize, (r1 - r0 + 1) as usize)
}

/// The corners of the only complete window with this many columns and rows; `None` if there are several or none.
pub(crate) fn full_window(grid: &Grid, columns: usize, rows: usize) -> Option<Vec<usize>> {
    let ((c0, r0), all_columns, all_rows) = extent(grid);
    if columns > all_columns || rows > all_rows {
        return None;
    }
    let mut found = None;
    for down in 0..=(all_rows - rows) as i32 {
        for right in 0..=(all_columns - columns) as i32 {
            let window: Option<Vec<usize>> = (0..(columns * rows) as i32)
                .map(|i| {
                    let (column, row) = (i % columns as i32, i / columns as i32);
                    grid.get(&(c0 + right + column, r0 + down + row)).copied()
                })
                .collect();
            if let Some(window) = window
                && found.replace(window).is_some()
            {
                return None;
            }
        }
    }
    found
}
