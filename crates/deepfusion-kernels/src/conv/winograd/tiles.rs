//! Divides outputs into tiles of 4×4, and these into tasks.

use crate::conv::product::{LANES, padded};
use crate::winograd::{AREA, OUT};
use std::ops::{Range, RangeInclusive};

/// Transformed inputs and products of a part of the tiles, in floats, so that they stay in a cache near the core.
const PART_FLOATS: usize = 300_000;
/// Number of tiles in a part; at least enough to make up for reading the transformed weights.
const PART_TILES: RangeInclusive<usize> = 48..=192;
/// If there are fewer tasks, the output channels are also divided among tasks, so that no core is idle.
const TASKS: usize = 4;

/// The tiles of a batch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    images: usize,
    down: usize,
    across: usize,
}

/// Neighbouring tiles of one row of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    pub(super) image: usize,
    /// The first output row and column.
    pub(super) y: usize,
    pub(super) x: usize,
    pub(super) tiles: usize,
    /// Index of the first tile in its task.
    pub(super) at: usize,
}

impl Grid {
    pub(super) fn new(images: usize, (height, width): (usize, usize)) -> Self {
        Self {
            images,
            down: height.div_ceil(OUT),
            across: width.div_ceil(OUT),
        }
    }

    pub(super) fn count(self) -> usize {
        self.images * self.down * self.across
    }

    /// The tiles and output channels of every task; they depend on sizes only.
    pub(super) fn tasks(self, channels: usize, rows: usize) -> Vec<(Range<usize>, Range<usize>)> {
        let parts = self.parts(channels + rows);
        let groups = TASKS.div_ceil(parts.len());
        let group = rows.div_ceil(groups).next_multiple_of(8);
        let mut tasks = Vec::new();
        for tiles in parts {
            for row in (0..rows).step_by(group) {
                tasks.push((tiles.clone(), row..(row + group).min(rows)));
            }
        }
        tasks
    }

    /// Whether the tiles, including those that extend beyond an edge, need at most half of the products of plain sums.
    pub(super) fn saves_half(self, (height, width): (usize, usize)) -> bool {
        2 * AREA * self.count() <= 9 * self.images * height * width
    }

    /// All tiles in parts, where a tile has `channels` transformed values for each product: whole rows of tiles, or pieces of rows that are
    /// longer than a part.
    pub(super) fn parts(self, channels: usize) -> Vec<Range<usize>> {
        let all = self.count();
        let most = (PART_FLOATS / (AREA * channels)).clamp(*PART_TILES.start(), *PART_TILES.end());
        // Results for the padding of the last vector are discarded.
        let waste = |rows: &usize| {
            let tiles = rows * self.across;
            (padded(tiles) * 1000 / tiles, usize::MAX - rows)
        };
        let rows = (1..=most / self.across).min_by_key(waste);
        let size = rows.map_or(most / LANES * LANES, |rows| rows * self.across);
        (0..all)
            .step_by(size)
            .map(|first| first..(first + size).min(all))
            .collect()
    }

    /// The runs of a task's tiles, row by row.
    pub(super) fn runs(self, tiles: Range<usize>) -> Vec<Run> {
        let (start, mut next, mut runs) = (tiles.start, tiles.start, Vec::new());
        while next < tiles.end {
            let (row, column) = (next / self.across, next % self.across);
            let count = (self.across - column).min(tiles.end - next);
            runs.push(Run {
                image: row / self.down,
                y: row % self.down * OUT,
                x: column * OUT,
                tiles: count,
                at: next - start,
            });
            next += count;
        }
        runs
    }
}
