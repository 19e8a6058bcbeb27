//! How Winograd's forms cut an image into tiles.
//!
//! A kernel dilated by r sees an image as r×r images, each every r-th row and column (phases): its tiles take every r-th pixel.

use crate::conv::Geometry;

/// The tiles of all phases of an image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tiles {
    /// Outputs of a tile along one side.
    side: usize,
    /// Tiles of a phase.
    across: usize,
    /// The same down.
    down: usize,
    /// Pixels from one of a phase to the next.
    step: usize,
}

/// A tile's first output pixel, and the step to the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TileOrigin {
    pub(crate) x: usize,
    pub(crate) y: usize,
    pub(crate) step: usize,
}

impl Tiles {
    /// Of `side` × `side` outputs each.
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
    /// How many of a tile's outputs across and down are pixels of the image.
    pub(crate) fn inside(self, g: &Geometry, side: usize) -> (usize, usize) {
        let within =
            |first: usize, all: usize| side.min(all.saturating_sub(first).div_ceil(self.step));
        (within(self.x, g.out.width), within(self.y, g.out.height))
    }
}
