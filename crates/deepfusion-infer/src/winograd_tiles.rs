//! How Winograd's forms divide an image into tiles.
//!
//! For a kernel dilated by r, an image consists of r×r images (phases) of every r-th row and column. Their tiles consist of every r-th
//! pixel.

use crate::conv::Geometry;

/// The tiles of all phases of an image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tiles {
    /// Outputs of a tile along one side.
    side: usize,
    /// Number of tiles in a phase, along x.
    across: usize,
    /// Number of tiles in a phase, along y.
    down: usize,
    /// Distance between neighbouring pixels of a phase, in pixels.
    step: usize,
}

/// A tile's first output pixel, and the distance to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TileOrigin {
    pub(crate) x: usize,
    pub(crate) y: usize,
    pub(crate) step: usize,
}

impl Tiles {
    /// Tiles of `side` × `side` outputs each.
    pub(crate) fn new(g: &Geometry, side: usize) -> Self {
        let of = |length: usize| length.div_ceil(g.dilation).div_ceil(side);
        Self {
            side,
            across: of(g.out.width),
            down: of(g.out.height),
            step: g.dilation,
        }
    }

    pub(crate) fn count(self) -> usize {
        self.across * self.down * self.step * self.step
    }

    pub(crate) fn of(self, tile: usize) -> TileOrigin {
        let (phase, tile) = (
            tile / (self.across * self.down),
            tile % (self.across * self.down),
        );
        let along = |tile: usize, phase: usize| tile * self.side * self.step + phase;
        TileOrigin {
            x: along(tile % self.across, phase % self.step),
            y: along(tile / self.across, phase / self.step),
            step: self.step,
        }
    }
}

impl TileOrigin {
    /// Number of a tile's outputs, along x and y, that are pixels of the image.
    pub(crate) fn inside(self, g: &Geometry, side: usize) -> (usize, usize) {
        let within =
            |first: usize, all: usize| side.min(all.saturating_sub(first).div_ceil(self.step));
        (within(self.x, g.out.width), within(self.y, g.out.height))
    }
}
