//! Padded pieces of images in which every tap of a kernel is a shift.

use super::bf16::{self, planar, zipped};
use std::ops::Range;

/// Number of floats of a tile's padded input and its output, so that they stay in the L2 cache.
const TILE_FLOATS: usize = 1 << 17;

/// Rows of one image, or all rows of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) first_image: usize,
    pub(super) images: usize,
    pub(super) first_row: usize,
    pub(super) rows: usize,
}

/// Divides the rows of each image, `rows` from `first_row` on, into tiles of about [`TILE_FLOATS`], where a row takes `row_floats`.
pub(super) fn tiles(images: usize, first_row: usize, rows: usize, row_floats: usize) -> Vec<Tile> {
    let wanted = (TILE_FLOATS / row_floats.max(1)).max(1);
    let whole = wanted / rows.max(1);
    let mut tiles = Vec::new();
    if whole >= 2 {
        // Equal tiles: if the last one had a single image, most of its product would be wasted.
        let groups = images.div_ceil(whole);
        for g in 0..groups {
            let first_image = g * images / groups;
            tiles.push(Tile {
                first_image,
                images: (g + 1) * images / groups - first_image,
                first_row,
                rows,
            });
        }
        return tiles;
    }
    let parts = rows.div_ceil(wanted);
    for first_image in 0..images {
        for part in 0..parts {
            let start = part * rows / parts;
            tiles.push(Tile {
                first_image,
                images: 1,
                first_row: first_row + start,
                rows: (part + 1) * rows / parts - start,
            });
        }
    }
    tiles
}

/// How a kernel samples an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Rows of padding above and below, columns left and right.
    pub(super) padding: (usize, usize),
    /// Whether the padding mirrors the image instead of being zero.
    pub(super) reflect: bool,
    pub(super) stride: usize,
    /// Distance between the first and the last tap, down and right.
    pub(super) reach: (usize, usize),
    /// Number of pixels in an output row.
    pub(super) out_width: usize,
}

/// A tile's padded input: tap (down, right) of the output pixel in column q reads
/// `q + offset(down, right)` of its channel's plane.
///
/// With stride s, a plane consists of s×s phases, each with every s-th row and column, which the taps read at stride 1. Zero padding is
/// shared: a row's right margin is the next row's left margin, and an image's bottom margin is the next image's top margin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    window: Window,
    tile: Tile,
    /// Distance between the rows of a phase.
    pitch: usize,
    /// Distance between the images of a phase, in rows.
    image_rows: usize,
    phase_len: usize,
    /// Length of a channel's plane.
    pub(super) plane_len: usize,
}

impl Lattice {
    pub(super) fn new(window: Window, tile: Tile) -> Self {
        let (down, right) = (
            window.reach.0 / window.stride,
            window.reach.1 / window.stride,
        );
        let shared = !window.reflect && window.stride == 1;
        let pitch = if shared {
            (window.width + window.padding.1).max(window.out_width)
        } else {
            window.out_width + right
        };
        let image_rows = if shared && tile.images > 1 {
            (window.height + window.padding.0).max(tile.rows)
        } else {
            tile.rows + down
        };
        // The last pixels' taps read beyond the last row, and the last block of columns reads a little further.
        let slack = (down + 1) * pitch + right + bf16::COLUMNS;
        let phase_len = tile.images * image_rows * pitch + slack;
        Self {
            window,
            tile,
            pitch,
            image_rows,
            phase_len,
            plane_len: window.stride * window.stride * phase_len,
        }
    }

    /// Number of pixels in a channel of an image.
    pub(super) fn image_area(&self) -> usize {
        self.window.height * self.window.width
    }

    /// Number of columns of a product over the whole tile, including the margins between its rows.
    pub(super) fn columns(&self) -> usize {
        self.column(self.tile.images - 1, self.tile.rows - 1) + self.window.out_width
    }

    /// Column of the first pixel of a row of the tile's n-th image.
    pub(super) fn column(&self, image: usize, row: usize) -> usize {
        (image * self.image_rows + row) * self.pitch
    }

    /// Columns of all output pixels, in order.
    pub(super) fn pixels(&self) -> Vec<usize> {
        let mut pixels = Vec::new();
        for image in 0..self.tile.images {
            for row in 0..self.tile.rows {
                let first = self.column(image, row);
                pixels.extend(first..first + self.window.out_width);
            }
        }
        pixels
    }

    /// Offset, in a channel's plane, of a tap that is `down` and `right` of the first one.
    pub(super) fn offset(&self, (down, right): (usize, usize)) -> usize {
        let s = self.window.stride;
        ((down % s) * s + right % s) * self.phase_len + (down / s) * self.pitch + right / s
    }

    /// Copies a channel of the tile's images into its padded plane; `image(n)` is that channel of the n-th image of the batch.
    pub(super) fn gather<'a>(&self, image: impl Fn(usize) -> &'a [f32], plane: &mut [f32]) {
        self.rows(plane, 0.0, |n, row, shift, to| {
            self.gather_row(image(n), row, shift, to);
        });
    }

    /// Copies two channels at once, rounded to bf16: each word of the plane contains both.
    pub(super) fn gather_pairs<'a>(
        &self,
        first: impl Fn(usize) -> &'a [f32],
        second: impl Fn(usize) -> &'a [f32],
        plane: &mut [u32],
    ) {
        let (mut a, mut b) = (vec![0.0; self.pitch], vec![0.0; self.pitch]);
        self.rows(plane, 0, |n, row, shift, to| {
            self.gather_row(first(n), row, shift, &mut a);
            self.gather_row(second(n), row, shift, &mut b);
            zipped(&a, &b, to);
        });
    }

    /// Copies one channel, rounded to bf16.
    pub(super) fn gather_halves<'a>(&self, image: impl Fn(usize) -> &'a [f32], plane: &mut [u16]) {
        let mut values = vec![0.0; self.pitch];
        self.rows(plane, 0, |n, row, shift, to| {
            self.gather_row(image(n), row, shift, &mut values);
            planar(&values, to);
        });
    }

    /// Calls `write` with every row of a plane: its image in the batch, its number in the tile, its phase's shift, and the row itself. The
    /// memory beyond the last row is cleared.
    fn rows<T: Copy>(
        &self,
        plane: &mut [T],
        zero: T,
        mut write: impl FnMut(usize, usize, (usize, usize), &mut [T]),
    ) {
        let s = self.window.stride;
        for (index, phase) in plane.chunks_exact_mut(self.phase_len).enumerate() {
            let shift = (index / s, index % s);
            for n in 0..self.tile.images {
                let start = self.column(n, 0);
                let rows = &mut phase[start..][..self.image_rows * self.pitch];
                for (row, to) in rows.chunks_exact_mut(self.pitch).enumerate() {
                    write(self.tile.first_image + n, row, shift, to);
                }
            }
            phase[self.column(self.tile.images, 0)..].fill(zero);
        }
    }

    fn gather_row(&self, image: &[f32], row: usize, (down, right): (usize, usize), to: &mut [f32]) {
        let Window {
            height,
            width,
            padding,
            reflect,
            stride,
            ..
        } = self.window;
        let y = (self.tile.first_row + row) * stride + down;
        let Some(y) = inside(y, padding.0, height, reflect) else {
            to.fill(0.0);
            return;
        };
        let from = &image[y * width..][..width];
        // Columns whose source is in the image: 0 <= stride·x + right − padding < width.
        let first = padding
            .1
            .saturating_sub(right)
            .div_ceil(stride)
            .min(to.len());
        let last = (width + padding.1)
            .saturating_sub(right)
            .div_ceil(stride)
            .clamp(first, to.len());
        for x in (0..first).chain(last..to.len()) {
            let source = inside(x * stride + right, padding.1, width, reflect);
            to[x] = source.map_or(0.0, |x| from[x]);
        }
        if first == last {
            return;
        }
        let from = &from[first * stride + right - padding.1..];
        let to = &mut to[first..last];
        if stride == 1 {
            to.copy_from_slice(&from[..to.len()]);
        } else {
            for (value, from) in to.iter_mut().zip(from.iter().step_by(stride)) {
                *value = *from;
            }
        }
    }
}

/// Gathers `wanted` of the `channels` channels of `x` into consecutive planes.
pub(super) fn gather_channels(
    lattice: &Lattice,
    x: &[f32],
    channels: usize,
    wanted: Range<usize>,
    planes: &mut [f32],
) {
    let area = lattice.image_area();
    for (channel, plane) in wanted.zip(planes.chunks_exact_mut(lattice.plane_len)) {
        lattice.gather(|n| &x[(n * channels + channel) * area..][..area], plane);
    }
}

/// The index that position `i` reads on an axis of `n` values with `padding` before them; `None` for zero padding.
pub(super) fn inside(i: usize, padding: usize, n: usize, reflect: bool) -> Option<usize> {
    if i >= padding && i - padding < n {
        return Some(i - padding);
    }
    if !reflect {
        return None;
    }
    if i < padding {
        return (padding - i < n).then(|| padding - i);
    }
    // Beyond the mirrored margin there is only unused space. It does not contribute to any pixel's sum, but to the rounding in Winograd's
    // tiles, so it must be finite.
    (2 * (n - 1)).checked_sub(i - padding)
}
