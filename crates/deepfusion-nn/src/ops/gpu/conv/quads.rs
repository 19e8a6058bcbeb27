//! How a group of threads loads the two factors of a product on tensor cores, as `rounded` arranged them: four numbers (a quad) at a time,
//! all loads of a step before any of its stores.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::cubecl::std::FastDivmod;
use half::bf16;

use super::factors::{Product, Share, Sizes};
use super::rounded::{QUAD, Quad};
use super::tile::{SIDE, THREADS, Tile, Window};

/// How a factor lies in shared memory, and which of its quads a thread loads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Lines {
    /// Number of lines: rows or columns, each with its terms; or terms, each with its rows or columns.
    count: usize,
    /// Quads of a line that neighbouring threads load, and how often they do.
    quads: usize,
    blocks: usize,
    /// Values from a line to the next: eight more than a line has, so that the lines of a square lie in different banks.
    pub(super) stride: usize,
}

impl Lines {
    /// Lines that are rows or columns, whose terms lie together: a block is 16 terms, which have the same tap.
    fn of_terms(lines: usize, depth: usize) -> Self {
        Self {
            count: lines,
            quads: SIDE / QUAD,
            blocks: depth / SIDE,
            stride: depth + 8,
        }
    }

    /// Lines that are terms, whose rows or columns lie together.
    fn term_after_term(lines: usize, depth: usize) -> Self {
        Self {
            count: depth,
            quads: lines / QUAD,
            blocks: 1,
            stride: lines + 8,
        }
    }

    pub(super) fn left(product: Product, tile: Tile) -> Self {
        Self::of(product, tile.rows, tile.depth)
    }

    pub(super) fn right(product: Product, tile: Tile) -> Self {
        Self::of(product, tile.columns, tile.depth)
    }

    /// The gradient of the weights sums over pixels, whose channels lie together. The other products sum over the channels.
    fn of(product: Product, lines: usize, depth: usize) -> Self {
        match product {
            Product::WeightGradient => Self::term_after_term(lines, depth),
            Product::Output | Product::InputGradient => Self::of_terms(lines, depth),
        }
    }

    /// Lines from a thread's quad to its next.
    fn step(self) -> usize {
        THREADS / self.quads
    }

    /// Number of quads of a block that a thread loads.
    fn passes(self) -> usize {
        self.count.div_ceil(self.step())
    }

    /// Number of quads in shared memory.
    pub(super) fn room(self) -> usize {
        self.count * self.stride / QUAD
    }
}

/// Divisors for computing indices into the tensors.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Divisors {
    /// Channels of the image that is read window by window.
    pub(super) channels: FastDivmod<usize>,
    /// Number of pixels of an image whose pixels are columns or terms, and of its rows.
    pub(super) area: FastDivmod<usize>,
    pub(super) width: FastDivmod<usize>,
}

/// A pixel that reads a window: the start of its image in the tensor that is read, in pixels, and the place of its first tap in the image.
/// For the gradient of the input: its distance from the first tap that reads it.
#[derive(CubeType)]
pub(super) struct Reader {
    image: usize,
    y: i32,
    x: i32,
}

#[cube]
fn reader(
    index: usize,
    sizes: &Sizes,
    divisors: &Divisors,
    #[comptime] product: Product,
    #[comptime] window: Window,
) -> Reader {
    let padding = comptime!(window.padding as i32);
    let (image, at) = divisors.area.div_mod(index);
    let (y, x) = divisors.width.div_mod(at);
    if comptime!(product == Product::InputGradient) {
        Reader {
            image: image * sizes.out_height * sizes.out_width,
            y: y as i32 + padding,
            x: x as i32 + padding,
        }
    } else {
        Reader {
            image: image * sizes.height * sizes.width,
            y: (y * window.stride) as i32 - padding,
            x: (x * window.stride) as i32 - padding,
        }
    }
}

/// The pixel that a tap reads, counted from the tensor's first, if it is in the image.
#[derive(CubeType)]
struct Read {
    exists: bool,
    pixel: usize,
}

#[cube]
fn read(
    own: &Reader,
    tap: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] window: Window,
) -> Read {
    let down = (tap / window.width * window.dilation) as i32;
    let across = (tap % window.width * window.dilation) as i32;
    if comptime!(product == Product::InputGradient) {
        let stride = comptime!(window.stride as i32);
        let (below, beside) = (own.y - down, own.x - across);
        let (y, x) = (below / stride, beside / stride);
        let is_read = below >= 0 && beside >= 0 && y * stride == below && x * stride == beside;
        let in_image = y < sizes.out_height as i32 && x < sizes.out_width as i32;
        Read {
            exists: is_read && in_image,
            pixel: own.image + y as usize * sizes.out_width + x as usize,
        }
    } else {
        let (y, x) = (own.y + down, own.x + across);
        Read {
            exists: y >= 0 && y < sizes.height as i32 && x >= 0 && x < sizes.width as i32,
            pixel: own.image + y as usize * sizes.width + x as usize,
        }
    }
}

/// What a thread keeps of the right factor from step to step: the pixels of its columns or, for the gradient of the weights, tap and
/// channel of its four columns.
#[derive(CubeType)]
pub(super) struct Columns {
    pixels: Sequence<Reader>,
    tap: usize,
    channel: usize,
}

#[cube]
pub(super) fn columns_of_thread(
    share: &Share,
    sizes: &Sizes,
    divisors: &Divisors,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) -> Columns {
    let lines = comptime!(Lines::right(product, tile));
    let thread = UNIT_POS as usize;
    let mut pixels = Sequence::<Reader>::new();
    if comptime!(product == Product::WeightGradient) {
        let column = share.first_column + thread % lines.quads * QUAD;
        let (tap, channel) = divisors.channels.div_mod(column);
        Columns {
            pixels,
            tap,
            channel,
        }
    } else {
        #[unroll]
        for pass in 0..lines.passes() {
            let column = share.first_column + thread / lines.quads + comptime!(pass * lines.step());
            pixels.push(reader(column, sizes, divisors, product, window));
        }
        Columns {
            pixels,
            tap: 0usize,
            channel: 0usize,
        }
    }
}

/// Loads a thread's quads of the left factor, for the terms from `start` on.
#[cube]
pub(super) fn load_left(
    values: &[Quad],
    share: &Share,
    start: usize,
    sizes: &Sizes,
    #[comptime] product: Product,
    #[comptime] tile: Tile,
) -> Sequence<Quad> {
    let lines = comptime!(Lines::left(product, tile));
    let thread = UNIT_POS as usize;
    let mut quads = Sequence::<Quad>::new();
    #[unroll]
    for block in 0..lines.blocks {
        #[unroll]
        for pass in 0..lines.passes() {
            let line = thread / lines.quads + comptime!(pass * lines.step());
            let within = (thread % lines.quads + comptime!(block * lines.quads)) * QUAD;
            let mut quad = Quad::new(bf16::from_int(0));
            if comptime!(product == Product::WeightGradient) {
                let (row, term) = (share.first_row + within, start + line);
                if line < lines.count && row < sizes.rows && term < share.end {
                    quad = values[(term * sizes.rows + row) / QUAD];
                }
            } else {
                let (row, term) = (share.first_row + line, start + within);
                if line < lines.count && row < sizes.rows && term < share.end {
                    quad = values[(row * sizes.depth + term) / QUAD];
                }
            }
            quads.push(quad);
        }
    }
    quads
}

/// The same for the right factor.
#[cube]
pub(super) fn load_right(
    values: &[Quad],
    columns: &Columns,
    share: &Share,
    start: usize,
    sizes: &Sizes,
    divisors: &Divisors,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) -> Sequence<Quad> {
    let lines = comptime!(Lines::right(product, tile));
    let thread = UNIT_POS as usize;
    let mut quads = Sequence::<Quad>::new();
    if comptime!(product == Product::WeightGradient) {
        let in_matrix = share.first_column + thread % lines.quads * QUAD < sizes.columns;
        #[unroll]
        for pass in 0..lines.passes() {
            let line = thread / lines.quads + comptime!(pass * lines.step());
            let term = start + line;
            let pixel = reader(term, sizes, divisors, product, window);
            let found = read(&pixel, columns.tap, sizes, product, window);
            let mut quad = Quad::new(bf16::from_int(0));
            if found.exists && in_matrix && line < lines.count && term < share.end {
                quad = values[(found.pixel * sizes.channels + columns.channel) / QUAD];
            }
            quads.push(quad);
        }
    } else {
        let channels = if comptime!(product == Product::InputGradient) {
            sizes.out_channels
        } else {
            sizes.channels
        };
        #[unroll]
        for block in 0..lines.blocks {
            let first = start + comptime!(block * SIDE);
            let (tap, channel) = divisors.channels.div_mod(first);
            let channel = channel + thread % lines.quads * QUAD;
            #[unroll]
            for pass in 0..lines.passes() {
                let line = thread / lines.quads + comptime!(pass * lines.step());
                let found = read(columns.pixels.index(pass), tap, sizes, product, window);
                let in_matrix = line < lines.count && share.first_column + line < sizes.columns;
                let mut quad = Quad::new(bf16::from_int(0));
                if found.exists && in_matrix && first < share.end {
                    quad = values[(found.pixel * channels + channel) / QUAD];
                }
                quads.push(quad);
            }
        }
    }
    quads
}

/// Stores a thread's quads in shared memory.
#[cube]
pub(super) fn store(quads: &Sequence<Quad>, into: &mut Shared<[Quad]>, #[comptime] lines: Lines) {
    let thread = UNIT_POS as usize;
    #[unroll]
    for block in 0..lines.blocks {
        #[unroll]
        for pass in 0..lines.passes() {
            let line = thread / lines.quads + comptime!(pass * lines.step());
            let within = thread % lines.quads + comptime!(block * lines.quads);
            if line < lines.count {
                into[line * comptime!(lines.stride / QUAD) + within] =
                    *quads.index(comptime!(block * lines.passes() + pass));
            }
        }
    }
}
