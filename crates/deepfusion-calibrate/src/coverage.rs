//! Where in the image corners were seen.

use nalgebra::Vector2;
use serde::Serialize;

/// Cells of the image for the covered share, across and down.
const CELLS: (usize, usize) = (8, 6);
/// Margins wider than this share cause a warning.
const WIDE_MARGIN: f64 = 0.15;

/// Distribution of the corners over the image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// Number of corners in each ninth of the image: rows from the top, each from the left.
    pub ninths: [[usize; 3]; 3],
    /// Share of the image's cells that contain a corner; a cell is an eighth of the width by a sixth of the height.
    pub share: f64,
    /// Strips of the image beyond the outermost corners, as shares of its width or height: left, top, right, bottom.
    pub margins: [f64; 4],
}

impl Coverage {
    /// The coverage by these corners of an image of this size.
    pub(crate) fn of<'a>(
        corners: impl Iterator<Item = &'a Vector2<f64>>,
        (width, height): (u32, u32),
    ) -> Self {
        let mut ninths = [[0; 3]; 3];
        let mut cells = [[false; CELLS.0]; CELLS.1];
        let mut margins = [1.0f64; 4];
        let part = |at: f64, side: u32, parts: usize| {
            let share = (at + 0.5) / f64::from(side);
            ((share * parts as f64).max(0.0) as usize).min(parts - 1)
        };
        for corner in corners {
            ninths[part(corner.y, height, 3)][part(corner.x, width, 3)] += 1;
            cells[part(corner.y, height, CELLS.1)][part(corner.x, width, CELLS.0)] = true;
            let (x, y) = (
                (corner.x + 0.5) / f64::from(width),
                (corner.y + 0.5) / f64::from(height),
            );
            for (margin, here) in margins.iter_mut().zip([x, y, 1.0 - x, 1.0 - y]) {
                *margin = margin.min(here.max(0.0));
            }
        }
        let filled = cells.iter().flatten().filter(|c| **c).count();
        Self {
            ninths,
            share: filled as f64 / (CELLS.0 * CELLS.1) as f64,
            margins,
        }
    }

    /// Edges of the image without corners near them, each with the width of the strip as a share of the image.
    #[must_use]
    pub fn wide_margins(&self) -> Vec<(&'static str, f64)> {
        let named = ["left", "top", "right", "bottom"].into_iter();
        let named = named.zip(self.margins);
        named.filter(|(_, share)| *share > WIDE_MARGIN).collect()
    }

    /// Names of the corner regions of the image without any board corner.
    #[must_use]
    pub fn empty_corners(&self) -> Vec<&'static str> {
        let named = [
            (0, 0, "top left"),
            (0, 2, "top right"),
            (2, 0, "bottom left"),
            (2, 2, "bottom right"),
        ];
        let empty = named
            .into_iter()
            .filter(|(r, c, _)| self.ninths[*r][*c] == 0);
        empty.map(|(_, _, name)| name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_counted_by_region() {
        // Left of the middle, from the top edge to the bottom edge.
        let corners = [(10.0, 0.0), (30.0, 50.0), (40.0, 99.0)].map(|(x, y)| Vector2::new(x, y));
        let coverage = Coverage::of(corners.iter(), (120, 100));
        assert_eq!(coverage.ninths, [[1, 0, 0], [1, 0, 0], [0, 1, 0]]);
        assert!((coverage.share - 3.0 / 48.0).abs() < 1e-12);
        assert_eq!(
            coverage.empty_corners(),
            ["top right", "bottom left", "bottom right"]
        );
        let wide = coverage.wide_margins();
        assert_eq!(wide.len(), 1);
        assert_eq!(wide[0].0, "right");
        assert!((wide[0].1 - (1.0 - 40.5 / 120.0)).abs() < 1e-12);
    }
}
