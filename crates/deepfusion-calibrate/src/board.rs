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
    /// Side of a square, in metres, where it was measured: a camera does not depend on it, the boards' distances do.
    pub square_m: Option<f64>,
}

impl Board {
    /// Fewest inner corners along a side: fewer cannot be distinguished from a pattern on a wall.
    pub const LEAST: usize = 3;
    /// Most of them; more are not resolved by any camera.
    pub const MOST: usize = 100;

    /// A board of so many inner corners and squares of this side, if that is known.
    ///
    /// # Errors
    /// [`Error::Board`] for fewer than 3 or more than 100 corners along a side, or a side that is no length.
    pub fn new(columns: usize, rows: usize, square_m: impl Into<Option<f64>>) -> Result<Self> {
        let square_m = square_m.into();
        let sides = Self::LEAST..=Self::MOST;
        let board = Self {
            columns,
            rows,
            square_m,
        };
        let sized = sides.contains(&columns) && sides.contains(&rows);
        if !sized || square_m.is_some_and(|side| !side.is_finite() || side <= 0.0) {
            return Err(Error::Board { board });
        }
        Ok(board)
    }

    /// Its inner corners, row after row, in metres, or in squares where their side is not known: the first is the origin, x along the row, y along the column, z = 0.
    #[must_use]
    pub fn points(&self) -> Vec<Vector3<f64>> {
        let side = self.square_m.unwrap_or(1.0);
        let at = |i: usize| {
            let (row, column) = (i / self.columns, i % self.columns);
            Vector3::new(column as f64, row as f64, 0.0) * side
        };
        (0..self.corners()).map(at).collect()
    }

    /// How large its squares are, for a text about it; nothing where that is not known.
    #[must_use]
    pub fn of_squares(&self) -> String {
        self.square_m
            .map_or_else(String::new, |side| format!(" with squares of {side} m"))
    }

    /// How many inner corners it has.
    #[must_use]
    pub fn corners(&self) -> usize {
        self.columns * self.rows
    }
}
