//! How a product of matrices is cut into tiles.

use burn_cubecl::cubecl::prelude::*;

use super::super::super::kernel::ConvOptions;
use super::super::grid::MOST_GROUPS;

/// Threads of a group.
pub(super) const THREADS: usize = 256;
/// Side of the square matrices that tensor cores multiply.
pub(super) const SIDE: usize = 16;
/// Groups that keep a large GPU busy: on tensor cores two for each of its 132 processors, as adding the parts of a sum up costs a launch more.
const ENOUGH: usize = 512;
const ENOUGH_ON_TENSOR_CORES: usize = 264;

/// What a group of threads computes of a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Tile {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// What a thread computes of it: rows and columns or, on tensor cores, what 32 threads compute of it, in squares of 16.
    pub(super) own_rows: usize,
    pub(super) own_columns: usize,
    /// Terms in shared memory at a time.
    pub(super) depth: usize,
    /// Whether weights are taken tap by tap, all channels of each, and not channel by channel.
    pub(super) tap_by_tap: bool,
    on_tensor_cores: bool,
}

impl Tile {
    /// As high as there are rows, since few channels have many pixels; large where that leaves enough tiles.
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

    /// The same tap by tap, where so many channels are a multiple of what lies together then.
    pub(super) fn tap_by_tap(self, channels: usize, together: usize) -> Self {
        Self {
            tap_by_tap: channels.is_multiple_of(together),
            ..self
        }
    }

    /// Tiles of a matrix.
    fn count(self, rows: usize, columns: usize) -> usize {
        rows.div_ceil(self.rows) * columns.div_ceil(self.columns)
    }

    /// In how many parts a sum of `depth` terms is shared out, and the terms of a part: more than one where there are few tiles, of
    /// `least` terms at least.
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

    /// Columns along the first two axes, since there may be too many for one; rows, and parts, along the third.
    pub(super) fn grid(self, rows: usize, columns: usize, parts: usize) -> CubeCount {
        let across = columns.div_ceil(self.columns);
        let lines = across.div_ceil(MOST_GROUPS);
        let layers = rows.div_ceil(self.rows) * parts;
        let count = [across.div_ceil(lines), lines, layers].map(|count| count as u32);
        CubeCount::Static(count[0], count[1], count[2])
    }

    /// Values of a factor of so many rows or columns in shared memory, term after term; one more than there are keeps threads out of
    /// each other's banks.
    pub(super) fn room(self, lines: usize) -> usize {
        self.depth * (lines + 1)
    }
}

/// What a pixel of the output reads of a channel.
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
