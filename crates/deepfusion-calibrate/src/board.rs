//! The board that is filmed.

use crate::{Error, Result};
use nalgebra::Vector3;
use serde::Serialize;

/// A flat checkerboard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Board {
    /// Inner corners in a row: one less than squares.
    pub columns: usize,
    /// Inner corners in a column.
    pub rows: usize,
    /// Side of a square, in metres.
    pub square_m: f64,
}

impl Board {
    /// Fewest inner corners along a side: fewer cannot be distinguished from a pattern on a wall.
    pub const LEAST: usize = 3;
    /// Most of them; more are not resolved by any camera.
    pub const MOST: usize = 100;

    /// A board of so many inner corners and squares of this side.
    ///
    /// # Errors
    /// [`Error::Board`] for fewer than 3 or more than 100 corners along a side, or a side that is no length.
    pub fn new(columns: usize, rows: usize, square_m: f64) -> Result<Self> {
        let sides = Self::LEAST..=Self::MOST;
        let board = Self {
            columns,
            rows,
            square_m,
        };
        let sized = sides.contains(&columns) && sides.contains(&rows);
        if !sized || !square_m.is_finite() || square_m <= 0.0 {
            return Err(Error::Board { board });
        }
        Ok(board)
    }

    /// Its inner corners, row after row, in metres: the first is the origin, x along the row, y along the column, z = 0.
    #[must_use]
    pub fn points(&self) -> Vec<Vector3<f64>> {
        let at = |i: usize| {
            let (row, column) = (i / self.columns, i % self.columns);
            Vector3::new(column as f64, row as f64, 0.0) * self.square_m
        };
        (0..self.corners()).map(at).collect()
    }

    /// How many inner corners it has.
    #[must_use]
    pub fn corners(&self) -> usize {
        self.columns * self.rows
    }
}
