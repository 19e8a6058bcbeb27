//! The calibration board.

use crate::{Error, Result};
use nalgebra::Vector3;
use serde::Serialize;

/// A flat checkerboard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Board {
    /// Inner corners in a row: one less than the number of squares.
    pub columns: usize,
    /// Inner corners in a column.
    pub rows: usize,
    /// Side of a square, in metres, if it was measured. The camera does not depend on it; the boards' distances do.
    pub square_m: Option<f64>,
}

impl Board {
    /// Fewest inner corners along a side: fewer cannot be distinguished from a pattern on a wall.
    pub const LEAST: usize = 3;
    /// Most inner corners along a side: no camera resolves more.
    pub const MOST: usize = 100;

    /// A board with this many inner corners, and squares with this side if it is known.
    ///
    /// # Errors
    /// [`Error::Board`] for fewer than 3 or more than 100 corners along a side, or if the side of a square is not above 0.
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

    /// The inner corners, row after row, in metres, or in squares if their side is unknown. The first is the origin, x is along the row, y
    /// along the column, z = 0.
    #[must_use]
    pub fn points(&self) -> Vec<Vector3<f64>> {
        let side = self.square_m.unwrap_or(1.0);
        let at = |i: usize| {
            let (row, column) = (i / self.columns, i % self.columns);
            Vector3::new(column as f64, row as f64, 0.0) * side
        };
        (0..self.corners()).map(at).collect()
    }

    /// " with squares of … m", for a text about the board; empty if their side is unknown.
    #[must_use]
    pub fn of_squares(&self) -> String {
        self.square_m
            .map_or_else(String::new, |side| format!(" with squares of {side} m"))
    }

    /// Number of inner corners.
    #[must_use]
    pub fn corners(&self) -> usize {
        self.columns * self.rows
    }
}
