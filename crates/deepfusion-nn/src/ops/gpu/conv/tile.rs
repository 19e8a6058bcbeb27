//! How a product of matrices is cut into tiles.

use burn_cubecl::cubecl::prelude::*;

use super::super::super::kernel::ConvOptions;
use super::super::grid::MOST_GROUPS;

/// Threads of a group.
pub(super) const THREADS: usize = 256;
/// Side of the square matrices that tensor cores multiply.
pub(super) const SIDE: usize = 16;
/// Number of groups that keep a large GPU busy. On tensor cores two for each of its 132 processors are enough, since adding up the parts of
/// a sum costs another launch.
const ENOUGH: usize = 512;
const ENOUGH_ON_TENSOR_CORES: usize = 264;

/// The part of a product that a group of threads computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Tile {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Rows and columns that a thread computes or, on tensor cores, those that 32 threads compute, in squares of 16.
    pub(super) own_rows: usize,
    pub(super) own_columns: usize,
    /// Number of terms in shared memory at a time.
    pub(super) depth: usize,
    /// Whether the terms run tap by tap, with all channels of each tap, and not channel by channel.
    pub(super) tap_by_tap: bool,
    on_tensor_cores: bool,
}

impl Tile {
    /// A tile for a product of this size. It is not much higher than the number of rows, since few channels have many pixels, and large if
    /// that leaves enough tiles.
    pub(super) fn of(rows: usize, columns: usize, tensor_cores: bool) -> Self {
        let tile = |rows, columns, own: [usize; 2], squares: [usize; 2]| Self {
            rows,
            columns,
            own_rows: if tensor_cores { squares[0] } else { own[0] },
            own_columns: if tensor_cores { squares[1] } else { own[1] },
            depth: if tensor_cores { 32 } else { 16 },
            tap_by_tap: tensor_cores,
            on_tensor_cores: tensor_cores,
        };
        let small = tile(64, 64, [4, 4], [1, 2]);
        let [large, small] = match rows {
            0..=16 => [tile(16, 256, [4, 4], [1, 2]); 2],
            17..=32 => [tile(32, 128, [4, 4], [1, 2]); 2],
            33..=64 => [tile(64, 256, [8, 8], [2, 4]), small],
            _ => [tile(128, 128, [8, 8], [2, 4]), small],
        };
        if large.count(rows, columns) >= ENOUGH / 2 {
            large
        } else {
            small
        }
    }

    /// The same tile, tap by tap if `channels` is a multiple of `together`, the number of values that then lie together.
    pub(super) fn tap_by_tap(self, channels: usize, together: usize) -> Self {
        Self {
            tap_by_tap: channels.is_multiple_of(together),
            ..self
        }
    }

    /// Number of tiles of a matrix.
    fn count(self, rows: usize, columns: usize) -> usize {
        rows.div_ceil(self.rows) * columns.div_ceil(self.columns)
    }

    /// The number of parts of a sum of `depth` terms, and the terms of a part. There are several parts, of at least `least` terms, if there
    /// are few tiles.
    pub(super) fn parts(
        self,
        rows: usize,
        columns: usize,
        depth: usize,
        least: usize,
    ) -> (usize, usize) {
        let enough = if self.on_tensor_cores {
            ENOUGH_ON_TENSOR_CORES
        } else {
            ENOUGH
        };
        let parts = enough
            .div_ceil(self.count(rows, columns))
            .min(depth / least)
            .max(1);
        let per_part = depth.div_ceil(parts).next_multiple_of(self.depth);
        (depth.div_ceil(per_part), per_part)
    }

    /// The grid: columns along the first two axes, since there may be too many for one; rows and parts along the third.
    pub(super) fn grid(self, rows: usize, columns: usize, parts: usize) -> CubeCount {
        let across = columns.div_ceil(self.columns);
        let lines = across.div_ceil(MOST_GROUPS);
        let layers = rows.div_ceil(self.rows) * parts;
        let count = [across.div_ceil(lines), lines, layers].map(|count| count as u32);
        CubeCount::Static(count[0], count[1], count[2])
    }

    /// Number of values in shared memory of a factor with `lines` rows or columns, term after term. Each term has one value more, to avoid
    /// bank conflicts.
    pub(super) fn room(self, lines: usize) -> usize {
        self.depth * (lines + 1)
    }
}

/// The window of a channel that an output pixel reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Window {
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
    pub(super) dilation: usize,
}

impl Window {
    pub(super) fn of([height, width]: [usize; 2], options: ConvOptions) -> Self {
        Self {
            height,
            width,
            stride: options.stride,
            padding: options.padding,
            dilation: options.dilation,
        }
    }

    pub(super) fn taps(self) -> usize {
        self.height * self.width
    }

    /// Height and width of the output.
    pub(super) fn output(self, [height, width]: [usize; 2]) -> [usize; 2] {
        let along = |size: usize, kernel: usize| {
            (size + 2 * self.padding - self.dilation * (kernel - 1) - 1) / self.stride + 1
        };
        [along(height, self.height), along(width, self.width)]
    }
}
