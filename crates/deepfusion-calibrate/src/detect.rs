//! The board in a picture.

use crate::Board;
use crate::complete::complete;
use crate::corners::{self, Corner};
use crate::grid::{self, Grid};
use image::{GrayImage, Luma};
use nalgebra::Vector2;

/// Longer side to which an image is reduced at first for the detector, in pixels.
const LOOKED_AT: u32 = 1280;
/// Half the window of a refinement: as a share of the distance to the next corner, at least and at most in pixels, and at most as a share
/// of the image's longer side. Large images are rarely sharp at the level of their pixels.
const WINDOW: f64 = 0.3;
const HALF_WINDOW_PX: (f64, f64) = (3.0, 11.0);
const HALF_WINDOW: f64 = 0.01;

/// What was found in a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum BoardDetection {
    /// The whole board: its inner corners in pixels, row after row as in [`Board::points`]. Where the board looks the same after a rotation
    /// (every board does after half a turn), the first corner may be another one. x turns to y as in the image.
    Board(Vec<Vector2<f64>>),
    /// A grid of another size, or a part of the board.
    Other {
        /// Columns of corners.
        columns: usize,
        /// Rows of corners.
        rows: usize,
        /// Number of corners found in that rectangle.
        corners: usize,
    },
    /// No grid.
    Nothing,
}

/// Finds the board's inner corners to some hundredths of a pixel. The whole board must be visible.
#[must_use]
pub fn find_board(image: &GrayImage, board: &Board) -> BoardDetection {
    let (width, height) = image.dimensions();
    if width < 16 || height < 16 {
        return BoardDetection::Nothing;
    }
    let first = width.max(height).div_ceil(LOOKED_AT).max(1);
    // Reduced further for blurred images, enlarged for small squares.
    let mut tries = vec![(first, false), (2 * first, false)];
    if first > 1 {
        tries.push((1, false));
    } else {
        tries.push((1, true));
    }
    let mut best = BoardDetection::Nothing;
    for (factor, doubled) in tries {
        let small = reduced(image, factor);
        let mut corners = corners::find(&small, doubled);
        let Some(mut grid) = grid::grow(&corners, board.corners()) else {
            continue;
        };
        complete(&small, &mut corners, &mut grid, (board.columns, board.rows));
        let corners = to_full_size(corners, factor);
        match board_corners(&grid, board) {
            Some(order) => {
                let start: Vec<_> = order.iter().map(|i| corners[*i].at).collect();
                if let Some(placed) = placed(image, &start, board) {
                    return BoardDetection::Board(placed);
                }
            }
            None => best = larger(best, &grid),
        }
    }
    best
}

/// The image reduced by this factor: each pixel is the mean of a square.
fn reduced(image: &GrayImage, factor: u32) -> GrayImage {
    if factor == 1 {
        return image.clone();
    }
    let (width, height) = (image.width() / factor, image.height() / factor);
    GrayImage::from_fn(width, height, |x, y| {
        let rows = (0..factor).flat_map(|dy| (0..factor).map(move |dx| (dx, dy)));
        let sum: u32 = rows
            .map(|(dx, dy)| u32::from(image.get_pixel(x * factor + dx, y * factor + dy).0[0]))
            .sum();
        let n = factor * factor;
        Luma([((sum + n / 2) / n) as u8])
    })
}

/// From the reduced image to the original one.
fn to_full_size(mut corners: Vec<Corner>, factor: u32) -> Vec<Corner> {
    let f = f64::from(factor);
    for corner in &mut corners {
        corner.at = corner.at.map(|n| f * (n + 0.5) - 0.5);
    }
    corners
}

/// The board's corners among those of the grid, in the board's order. The number of columns may be that of its longer or its shorter side.
fn board_corners(grid: &Grid, board: &Board) -> Option<Vec<usize>> {
    let (columns, rows) = (board.columns, board.rows);
    let (_, all_columns, all_rows) = grid::extent(grid);
    let upright = grid::full_window(grid, columns, rows);
    let turned = || {
        // The board's columns are the grid's rows.
        let found = grid::full_window(grid, rows, columns)?;
        let at = |i: usize| found[(i % columns) * rows + i / columns];
        Some((0..columns * rows).map(at).collect())
    };
    let order = match upright {
        Some(order) => order,
        None if columns != rows => turned()?,
        None => return None,
    };
    // A stray corner beside the board is ignored; most of another row means another board.
    let around = all_columns * all_rows;
    let strays = grid.len() - order.len();
    let another = strays * 2 >= columns.min(rows) && grid.len() * 10 > around * 9;
    (!another).then_some(order)
}

/// Refined positions, in an order in which x turns to y as in the image.
fn placed(image: &GrayImage, start: &[Vector2<f64>], board: &Board) -> Option<Vec<Vector2<f64>>> {
    let (columns, rows) = (board.columns, board.rows);
    let at = |column: usize, row: usize| start[row * columns + column];
    let side = f64::from(image.width().max(image.height()));
    let widest = HALF_WINDOW_PX.1.max(HALF_WINDOW * side);
    let mut placed = Vec::with_capacity(start.len());
    for row in 0..rows {
        for column in 0..columns {
            let here = at(column, row);
            let sides = [
                (column > 0).then(|| at(column - 1, row)),
                (column + 1 < columns).then(|| at(column + 1, row)),
                (row > 0).then(|| at(column, row - 1)),
                (row + 1 < rows).then(|| at(column, row + 1)),
            ];
            let nearest = sides.into_iter().flatten();
            let nearest = nearest.map(|p| (p - here).norm()).fold(f64::MAX, f64::min);
            let half = (WINDOW * nearest).clamp(HALF_WINDOW_PX.0, widest);
            placed.push(corners::refine_corner(image, here, half.round() as i32)?);
        }
    }
    let last = |column: usize, row: usize| placed[row * columns + column];
    let (along, down) = (
        last(columns - 1, 0) - last(0, 0),
        last(0, rows - 1) - last(0, 0),
    );
    if along.perp(&down) < 0.0 {
        // The order is mirrored: reverse each row.
        for row in placed.chunks_mut(columns) {
            row.reverse();
        }
    }
    Some(placed)
}

fn larger(best: BoardDetection, grid: &Grid) -> BoardDetection {
    let (_, columns, rows) = grid::extent(grid);
    let corners = grid.len();
    match best {
        BoardDetection::Other { corners: n, .. } if n >= corners => best,
        _ => BoardDetection::Other {
            columns: columns.max(rows),
            rows: columns.min(rows),
            corners,
        },
    }
}
