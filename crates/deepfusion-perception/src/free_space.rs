//! Free space: the drivable ground, seen from above.

use crate::{Ground, Obstacles, PerceptionConfig, Rays};
use serde::Serialize;

/// The state of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Cell {
    /// Not visible.
    Unknown,
    /// Ground was seen there, with nothing in front of it.
    Free,
    /// An obstacle is there.
    Occupied,
}

/// A grid on the ground, ahead of the camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FreeSpace {
    /// Side of a cell, in metres.
    pub cell_m: f32,
    /// Number of cells across; the camera looks along the middle.
    pub width: usize,
    /// Number of cells forward.
    pub length: usize,
    /// `length * width` cells: the row nearest to the camera first, each from left to right.
    pub cells: Vec<Cell>,
}

/// Smallest number of obstacle pixels in an occupied cell.
const WITNESSES: u16 = 3;

impl FreeSpace {
    /// An empty grid with cells of `cell_m`, reaching `length_m` forward and half as far to each side.
    #[must_use]
    pub fn new(cell_m: f32, length_m: f32) -> Self {
        let length = ((length_m / cell_m) as usize).max(1);
        Self {
            cell_m,
            width: length,
            length,
            cells: vec![Cell::Unknown; length * length],
        }
    }

    /// Index of the cell at a point (right, forward, metres); `None` outside the grid.
    #[must_use]
    pub fn at(&self, right_m: f32, forward_m: f32) -> Option<Cell> {
        self.index(right_m, forward_m).map(|i| self.cells[i])
    }

    fn index(&self, right_m: f32, forward_m: f32) -> Option<usize> {
        let column = (right_m / self.cell_m + 0.5 * self.width as f32).floor();
        let row = (forward_m / self.cell_m).floor();
        let inside =
            (0.0..self.width as f32).contains(&column) && (0.0..self.length as f32).contains(&row);
        inside.then(|| row as usize * self.width + column as usize)
    }

    /// Fills the grid from a depth image, row by row, and its obstacles.
    ///
    /// A cell is free if the ray to it meets no obstacle first and the image shows ground at its distance. It is occupied if obstacle
    /// pixels fall into it.
    pub fn fill(
        &mut self,
        depth: &[f32],
        obstacles: &Obstacles,
        rays: &Rays,
        ground: &Ground,
        config: &PerceptionConfig,
    ) {
        let width = rays.x.len();
        self.cells.fill(Cell::Unknown);
        let mut witnesses = vec![0u16; self.cells.len()];
        // For each column: the distance of the first obstacle, and the range in which ground is visible, forward in metres.
        let mut first = vec![f32::INFINITY; width];
        let mut seen = vec![0.0f32; width];
        let mut from = vec![f32::INFINITY; width];
        for (v, row) in depth.chunks_exact(width).enumerate() {
            for (u, z) in row.iter().enumerate() {
                if *z <= 0.0 || *z > config.max_depth_m {
                    continue;
                }
                let [right, forward, height] = ground.locate(rays.point(u, v, *z));
                if obstacles.height[v * width + u] >= 0.0 {
                    first[u] = first[u].min(forward);
                    if let Some(i) = self.index(right, forward) {
                        witnesses[i] = witnesses[i].saturating_add(1);
                    }
                } else if height < config.min_height_m {
                    seen[u] = seen[u].max(forward);
                    from[u] = from[u].min(forward);
                }
            }
        }
        for row in 0..self.length {
            let forward = (row as f32 + 0.5) * self.cell_m;
            for column in 0..self.width {
                let right = (column as f32 + 0.5 - 0.5 * self.width as f32) * self.cell_m;
                let i = row * self.width + column;
                if witnesses[i] >= WITNESSES {
                    self.cells[i] = Cell::Occupied;
                    continue;
                }
                let u = rays.x.partition_point(|x| *x < right / forward);
                let ground_seen = || (from[u]..=seen[u]).contains(&forward);
                if (1..width).contains(&u) && forward < first[u] && ground_seen() {
                    self.cells[i] = Cell::Free;
                }
            }
        }
    }
}
