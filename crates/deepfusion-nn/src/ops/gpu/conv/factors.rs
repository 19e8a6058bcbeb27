//! How a group of threads loads the two factors of a product in single precision into shared memory, and where it writes the result.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

use super::tile::{SIDE, THREADS, Tile, Window};

/// Which product is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Product {
    Output,
    InputGradient,
    WeightGradient,
}

impl Product {
    /// Fewest terms for which another group of threads pays off, if there are few groups.
    pub(super) fn least_terms(self) -> usize {
        match self {
            Self::Output | Self::InputGradient => 512,
            Self::WeightGradient => 256,
        }
    }
}

/// Sizes of a convolution's tensors, and of the product.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Sizes {
    pub(super) channels: usize,
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) out_channels: usize,
    pub(super) out_height: usize,
    pub(super) out_width: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) depth: usize,
}

/// A pixel of the output, given by the start of its window in the input. For the gradient of the input: a pixel of the input, given by its
/// distance from the first tap that reads it.
#[derive(CubeType)]
pub(super) struct Pixel {
    image: usize,
    y: i32,
    x: i32,
}

#[cube]
pub(super) fn pixel_of(
    index: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
) -> Pixel {
    let padding = comptime!(window.padding as i32);
    if comptime!(product == Product::InputGradient) {
        let area = sizes.height * sizes.width;
        let at = index % area;
        Pixel {
            image: index / area,
            y: (at / sizes.width) as i32 + padding,
            x: (at % sizes.width) as i32 + padding,
        }
    } else {
        let area = sizes.out_height * sizes.out_width;
        let at = index % area;
        Pixel {
            image: index / area,
            y: (at / sizes.out_width * window.stride) as i32 - padding,
            x: (at % sizes.out_width * window.stride) as i32 - padding,
        }
    }
}

/// Channel and tap of a term's weight or, for the gradient of the weights, of a column's.
#[cube]
fn channel_and_tap(
    index: usize,
    channels: usize,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) -> (usize, usize) {
    let taps = comptime!(window.taps());
    if comptime!(tile.tap_by_tap) {
        (index % channels, index / channels)
    } else {
        (index / taps, index % taps)
    }
}

/// Index of a left factor's weight in a layer's weights.
#[cube]
fn weight_place(
    row: usize,
    term: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) -> usize {
    let taps = comptime!(window.taps());
    if comptime!(product == Product::InputGradient) {
        let (channel, tap) = channel_and_tap(term, sizes.out_channels, window, tile);
        (channel * sizes.channels + row) * taps + tap
    } else {
        let (channel, tap) = channel_and_tap(term, sizes.channels, window, tile);
        (row * sizes.channels + channel) * taps + tap
    }
}

/// Arranges weights as a left factor, row after row and tap by tap. Without this, neighbouring threads would repeatedly read distant
/// values.
#[cube(launch_unchecked)]
pub(super) fn weights_by_taps(
    weights: &[f32],
    out: &mut [f32],
    sizes: Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) {
    let at = ABSOLUTE_POS;
    if at < sizes.rows * sizes.depth {
        let (row, term) = (at / sizes.depth, at % sizes.depth);
        out[at] = weights[weight_place(row, term, &sizes, product, window, tile)];
    }
}

/// Loads the terms `start` to `end` of the left factor's rows.
#[cube]
pub(super) fn bring_left(
    values: &[f32],
    into: &mut Shared<[f32]>,
    first_row: usize,
    start: usize,
    end: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) {
    let own = UNIT_POS as usize % tile.depth;
    let term = start + own;
    #[unroll]
    for i in 0..tile.rows * tile.depth / THREADS {
        let line = UNIT_POS as usize / tile.depth + comptime!(i * THREADS / tile.depth);
        let row = first_row + line;
        let mut value = 0.0f32;
        if row < sizes.rows && term < end {
            let at = if comptime!(product == Product::WeightGradient) {
                let area = sizes.out_height * sizes.out_width;
                (term / area * sizes.rows + row) * area + term % area
            } else if comptime!(tile.tap_by_tap || product == Product::Output) {
                // In the order of `weights_by_taps`, or in the layer's own order.
                row * sizes.depth + term
            } else {
                weight_place(row, term, sizes, product, window, tile)
            };
            value = values[at];
        }
        into[own * comptime!(tile.rows + 1) + line] = value;
    }
}

/// The place of a value of the right factor in its tensor, if it lies inside: the value that a channel's tap reads for a pixel of the
/// output. For the gradient of the input: the gradient of the output pixel that reads the input pixel through the tap.
#[derive(CubeType)]
struct Source {
    exists: bool,
    at: usize,
}

#[cube]
fn source(
    pixel: &Pixel,
    channel: usize,
    tap: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
) -> Source {
    let down = (tap / window.width * window.dilation) as i32;
    let across = (tap % window.width * window.dilation) as i32;
    if comptime!(product == Product::InputGradient) {
        let stride = comptime!(window.stride as i32);
        let (below, beside) = (pixel.y - down, pixel.x - across);
        let (y, x) = (below / stride, beside / stride);
        let is_read = below >= 0 && beside >= 0 && y * stride == below && x * stride == beside;
        let in_image = y < sizes.out_height as i32 && x < sizes.out_width as i32;
        let plane = pixel.image * sizes.out_channels + channel;
        Source {
            exists: is_read && in_image,
            at: (plane * sizes.out_height + y as usize) * sizes.out_width + x as usize,
        }
    } else {
        let (y, x) = (pixel.y + down, pixel.x + across);
        let plane = pixel.image * sizes.channels + channel;
        Source {
            exists: y >= 0 && y < sizes.height as i32 && x >= 0 && x < sizes.width as i32,
            at: (plane * sizes.height + y as usize) * sizes.width + x as usize,
        }
    }
}

/// Loads the terms `start` to `end` of the right factor's columns. `own` is the pixel of this thread's column, if columns are pixels.
///
/// Tap by tap, all 16 terms of a block (for the gradient of the weights: all columns of a tile) have the same tap, so that the next term is
/// one plane of the image further. Otherwise the place of every value is computed.
#[cube]
pub(super) fn bring_right(
    values: &[f32],
    into: &mut Shared<[f32]>,
    own: &Pixel,
    first_column: usize,
    start: usize,
    end: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) {
    let thread = UNIT_POS as usize;
    if comptime!(product == Product::WeightGradient) {
        let own_term = thread % tile.depth;
        let term = start + own_term;
        let pixel = pixel_of(term, sizes, product, window);
        let first_line = thread / tile.depth;
        if comptime!(tile.tap_by_tap) {
            let column = first_column + first_line;
            let (channel, tap) = channel_and_tap(column, sizes.channels, window, tile);
            let first = source(&pixel, channel, tap, sizes, product, window);
            let exists = first.exists && term < end;
            let plane = sizes.height * sizes.width;
            #[unroll]
            for i in 0..tile.columns * tile.depth / THREADS {
                let line = comptime!(i * THREADS / tile.depth);
                let mut value = 0.0f32;
                if exists {
                    value = values[first.at + line * plane];
                }
                into[own_term * comptime!(tile.columns + 1) + first_line + line] = value;
            }
        } else {
            #[unroll]
            for i in 0..tile.columns * tile.depth / THREADS {
                let line = first_line + comptime!(i * THREADS / tile.depth);
                let column = first_column + line;
                let (channel, tap) = channel_and_tap(column, sizes.channels, window, tile);
                let found = source(&pixel, channel, tap, sizes, product, window);
                let mut value = 0.0f32;
                if found.exists && column < sizes.columns && term < end {
                    value = values[found.at];
                }
                into[own_term * comptime!(tile.columns + 1) + line] = value;
            }
        }
    } else {
        let line = thread % tile.columns;
        let in_matrix = first_column + line < sizes.columns;
        let first_term = thread / tile.columns;
        let (channels, plane) = if comptime!(product == Product::InputGradient) {
            (sizes.out_channels, sizes.out_height * sizes.out_width)
        } else {
            (sizes.channels, sizes.height * sizes.width)
        };
        if comptime!(tile.tap_by_tap) {
            #[unroll]
            for block in 0..tile.depth / SIDE {
                let own_term = first_term + comptime!(block * SIDE);
                let (channel, tap) = channel_and_tap(start + own_term, channels, window, tile);
                let first = source(own, channel, tap, sizes, product, window);
                let exists = first.exists && in_matrix && start + own_term < end;
                #[unroll]
                for i in 0..tile.columns * SIDE / THREADS {
                    let term = comptime!(i * THREADS / tile.columns);
                    let mut value = 0.0f32;
                    if exists {
                        value = values[first.at + term * plane];
                    }
                    into[(own_term + term) * comptime!(tile.columns + 1) + line] = value;
                }
            }
        } else {
            #[unroll]
            for i in 0..tile.columns * tile.depth / THREADS {
                let own_term = first_term + comptime!(i * THREADS / tile.columns);
                let (channel, tap) = channel_and_tap(start + own_term, channels, window, tile);
                let found = source(own, channel, tap, sizes, product, window);
                let mut value = 0.0f32;
                if found.exists && in_matrix && start + own_term < end {
                    value = values[found.at];
                }
                into[own_term * comptime!(tile.columns + 1) + line] = value;
            }
        }
    }
}

/// Where a column's first row is written, and the distance from row to row. The parts of a sum follow each other.
#[cube]
pub(super) fn result_place(
    column: usize,
    part: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) -> (usize, usize) {
    if comptime!(product == Product::WeightGradient) {
        let (channel, tap) = channel_and_tap(column, sizes.channels, window, tile);
        let weight = channel * comptime!(window.taps()) + tap;
        (part * sizes.rows * sizes.columns + weight, sizes.columns)
    } else {
        let area = if comptime!(product == Product::Output) {
            sizes.out_height * sizes.out_width
        } else {
            sizes.height * sizes.width
        };
        let image = part * (sizes.columns / area) + column / area;
        (image * sizes.rows * area + column % area, area)
    }
}

/// What a group computes: its first row and column, which part of the sums, and that part's range of terms.
#[derive(CubeType)]
pub(super) struct Share {
    pub(super) first_row: usize,
    pub(super) first_column: usize,
    pub(super) part: usize,
    pub(super) start: usize,
    pub(super) end: usize,
}

#[cube]
pub(super) fn share_of_group(sizes: &Sizes, per_part: usize, #[comptime] tile: Tile) -> Share {
    let row_tiles = sizes.rows.div_ceil(tile.rows);
    let part = CUBE_POS_Z as usize / row_tiles;
    let start = part * per_part;
    Share {
        first_row: CUBE_POS_Z as usize % row_tiles * tile.rows,
        first_column: (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize * tile.columns,
        part,
        start,
        end: (start + per_part).min(sizes.depth),
    }
}
