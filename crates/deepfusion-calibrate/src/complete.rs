//! Corners of the board that the detector missed, searched for where their neighbours predict them.

use crate::corners::{Corner, grey, refine_corner};
use crate::grid::{Grid, extent};
use image::GrayImage;
use nalgebra::Vector2;

/// Greatest distance of a corner from its predicted position, as a share of a step.
const REACH: f64 = 0.3;
/// Least difference between the dark and bright squares around a corner, in grey values.
const LEAST_CONTRAST: f64 = 12.0;
/// Greatest number of rounds: a corner that was found may predict its neighbours.
const ROUNDS: usize = 4;

/// Fills gaps in a grid that should have this many columns and rows, in either order: positions between and beside known corners. New
/// corners are appended to `corners`.
pub(crate) fn complete(
    image: &GrayImage,
    corners: &mut Vec<Corner>,
    grid: &mut Grid,
    (columns, rows): (usize, usize),
) {
    for _ in 0..ROUNDS {
        let ((c0, r0), across, down) = extent(grid);
        let fits = |a: usize, b: usize| a <= columns && b <= rows || a <= rows && b <= columns;
        if !fits(across, down) {
            return;
        }
        let mut found = Vec::new();
        // Also one position beyond the grid: a whole row may be missing.
        for row in r0 - 1..=r0 + down as i32 {
            for column in c0 - 1..=c0 + across as i32 {
                let at = (column, row);
                if !grid.contains_key(&at)
                    && let Some(corner) = corner_at(image, corners, grid, at)
                {
                    found.push((at, corner));
                }
            }
        }
        let mut filled = false;
        for (at, corner) in found {
            grid.insert(at, corners.len());
            let (_, across, down) = extent(grid);
            if fits(across, down) {
                corners.push(corner);
                filled = true;
            } else {
                grid.remove(&at);
            }
        }
        if !filled {
            return;
        }
    }
}

/// The corner at a position of the grid, if the image has one there.
fn corner_at(
    image: &GrayImage,
    corners: &[Corner],
    grid: &Grid,
    (column, row): (i32, i32),
) -> Option<Corner> {
    let at = |c: i32, r: i32| Some(corners[*grid.get(&(column + c, row + r))?].at);
    // Two neighbours on the same side are extrapolated; two on opposite sides are averaged.
    let mut guesses = Vec::new();
    let mut steps = [Vector2::zeros(); 2];
    for (side, (dc, dr)) in [(1, 0), (0, 1)].into_iter().enumerate() {
        if let (Some(before), Some(after)) = (at(-dc, -dr), at(dc, dr)) {
            guesses.push((before + after) / 2.0);
            steps[side] = (after - before) / 2.0;
            continue;
        }
        for sign in [1, -1] {
            if let (Some(near), Some(far)) =
                (at(sign * dc, sign * dr), at(2 * sign * dc, 2 * sign * dr))
            {
                // The steps keep changing as they did before.
                let third = at(3 * sign * dc, 3 * sign * dr);
                guesses.push(third.map_or(near * 2.0 - far, |third| (near - far) * 3.0 + third));
                steps[side] = (far - near) * f64::from(sign);
            }
        }
    }
    // There must be a prediction in both directions.
    if steps.iter().any(|s| s.norm() < 3.0) {
        return None;
    }
    let guess = guesses.iter().sum::<Vector2<f64>>() / guesses.len() as f64;
    let step = steps[0].norm().min(steps[1].norm());
    let half = (0.4 * step).clamp(2.0, 8.0).round() as i32;
    let (width, height) = image.dimensions();
    let inside = |p: &Vector2<f64>| {
        (1.0..=f64::from(width) - 2.0).contains(&p.x)
            && (1.0..=f64::from(height) - 2.0).contains(&p.y)
    };
    let found = refine_corner(image, guess, half).filter(inside)?;
    if (found - guess).norm() > REACH * step || !crosswise(image, found, steps) {
        return None;
    }
    let angle = |s: Vector2<f64>| s.y.atan2(s.x);
    Some(Corner {
        at: found,
        edges: steps.map(angle),
        response: 0.0,
    })
}

/// Whether opposite squares around a point are alike, and neighbouring ones are not.
fn crosswise(image: &GrayImage, at: Vector2<f64>, [right, down]: [Vector2<f64>; 2]) -> bool {
    let square = |a: f64, b: f64| {
        let p = at + (right * a + down * b) * 0.3;
        grey(image, p.x, p.y)
    };
    let (a, c) = (square(1.0, 1.0), square(-1.0, -1.0));
    let (b, d) = (square(1.0, -1.0), square(-1.0, 1.0));
    let contrast = ((a + c) - (b + d)).abs() / 2.0;
    let unlike = (a - c).abs().max((b - d).abs());
    contrast > LEAST_CONTRAST && unlike < 0.5 * contrast
}
