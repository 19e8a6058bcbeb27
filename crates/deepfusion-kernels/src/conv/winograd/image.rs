//! Conversion from planar images to tiles and back.

use super::tiles::Run;
use super::transform::TransformInputs;
use crate::conv::ConvShape;
use crate::conv::lattice::inside;
use crate::winograd::{AREA, IN, OUT};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// The images that are summed over, N×C×H×W.
#[derive(Debug, Clone, Copy)]
pub(in crate::conv) struct Image<'a> {
    pub(in crate::conv) values: &'a [f32],
    pub(in crate::conv) images: usize,
    pub(in crate::conv) channels: usize,
    /// Height and width.
    pub(in crate::conv) size: (usize, usize),
    /// Rows and columns of padding before the first.
    pub(in crate::conv) padding: usize,
    /// Whether the padding mirrors the image instead of being zero.
    pub(in crate::conv) reflect: bool,
}

impl<'a> Image<'a> {
    /// A convolution's input.
    pub(in crate::conv) fn of(shape: &ConvShape, values: &'a [f32]) -> Self {
        Self {
            values,
            images: shape.batch,
            channels: shape.in_channels,
            size: (shape.in_height, shape.in_width),
            padding: shape.padding,
            reflect: shape.reflect,
        }
    }

    /// Number of floats in a buffer for one line of a run's inputs, or of its outputs.
    pub(super) fn line_len(&self, runs: &[Run]) -> usize {
        let tiles = runs.iter().map(|run| run.tiles).max().unwrap_or(0);
        OUT * (tiles + 1)
    }

    /// Bᵀ d B of the inputs of all tiles of some channels: `to[((channel − first)·36 + product)·tiles + tile]`, where `tiles` must be whole
    /// vectors. `plain` must have room for a channel's inputs, `line` for [`Self::line_len`].
    pub(super) fn transform(
        &self,
        channels: Range<usize>,
        runs: &[Run],
        tiles: usize,
        (plain, line): (&mut [f32], &mut [f32]),
        to: &mut [f32],
    ) {
        for (channel, to) in channels.zip(to.chunks_exact_mut(AREA * tiles)) {
            self.gather(channel, runs, line, plain, tiles);
            Arch::new().dispatch(TransformInputs {
                from: plain,
                pitch: tiles,
                tiles,
                to,
                to_pitch: tiles,
            });
        }
    }

    /// Copies a channel's inputs of all tiles: `to[(6·row + column)·pitch + tile]`.
    fn gather(&self, channel: usize, runs: &[Run], line: &mut [f32], to: &mut [f32], pitch: usize) {
        Arch::new().dispatch(Gather {
            image: self,
            channel,
            runs,
            line,
            to,
            pitch,
        });
    }

    /// Input row `y` of the padded image, from column `x` on.
    #[inline(always)]
    fn line(&self, image: usize, channel: usize, y: usize, x: usize, line: &mut [f32]) {
        let (height, width) = self.size;
        let Some(y) = inside(y, self.padding, height, self.reflect) else {
            return line.fill(0.0);
        };
        let row = ((image * self.channels + channel) * height + y) * width;
        let row = &self.values[row..][..width];
        let first = self.padding.saturating_sub(x).min(line.len());
        let last = (width + self.padding)
            .saturating_sub(x)
            .clamp(first, line.len());
        for at in (0..first).chain(last..line.len()) {
            let from = inside(x + at, self.padding, width, self.reflect);
            line[at] = from.map_or(0.0, |x| row[x]);
        }
        if first < last {
            let from = &row[x + first - self.padding..][..last - first];
            line[first..last].copy_from_slice(from);
        }
    }
}

struct Gather<'a> {
    image: &'a Image<'a>,
    channel: usize,
    runs: &'a [Run],
    line: &'a mut [f32],
    to: &'a mut [f32],
    pitch: usize,
}

impl WithSimd for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for run in self.runs {
            // The last tile reads two columns of the next one's.
            let line = &mut self.line[..OUT * (run.tiles + 1)];
            for (i, rows) in self
                .to
                .chunks_exact_mut(IN * self.pitch)
                .enumerate()
                .take(IN)
            {
                self.image
                    .line(run.image, self.channel, run.y + i, run.x, line);
                let mut columns = rows.chunks_exact_mut(self.pitch);
                let columns: [Option<&mut [f32]>; IN] = std::array::from_fn(|_| columns.next());
                let columns = columns.map(|column| {
                    column.map_or_else(Default::default, |c| &mut c[run.at..][..run.tiles])
                });
                let [a, b, c, d, e, f] = columns;
                deinterleave(line, [&mut *a, &mut *b, c, d]);
                // The fifth and sixth column of a tile are the first and second of the next.
                let last = run.tiles - 1;
                e[..last].copy_from_slice(&a[1..]);
                f[..last].copy_from_slice(&b[1..]);
                (e[last], f[last]) = (line[OUT * run.tiles], line[OUT * run.tiles + 1]);
            }
        }
    }
}

/// Calls `write` with each line of outputs in an image of `size`: its row, its first column and its values, from
/// `from[(4·row + column)·pitch + tile]`.
pub(super) fn scatter(
    size: (usize, usize),
    runs: &[Run],
    from: &[f32],
    pitch: usize,
    line: &mut [f32],
    mut write: impl FnMut(&Run, (usize, usize), &[f32]),
) {
    let (height, width) = size;
    for run in runs {
        for i in 0..OUT.min(height - run.y) {
            let column = |j: usize| &from[(i * OUT + j) * pitch + run.at..][..run.tiles];
            let line = &mut line[..OUT * run.tiles];
            Arch::new().dispatch(Interleave {
                from: std::array::from_fn(column),
                line,
            });
            let count = line.len().min(width - run.x);
            write(run, (run.y + i, run.x), &line[..count]);
        }
    }
}

struct Interleave<'a> {
    from: [&'a [f32]; 4],
    line: &'a mut [f32],
}

impl WithSimd for Interleave<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        interleave(self.from, self.line);
    }
}

/// The gradient in the mirrored margin, one pixel wide, of an image. It is kept until all of the image is complete, as it belongs to pixels
/// that other tasks write.
#[derive(Debug, Clone, Copy)]
pub(in crate::conv) struct Margins {
    /// Height and width of the image.
    size: (usize, usize),
}

impl Margins {
    pub(in crate::conv) fn new(size: (usize, usize)) -> Self {
        Self { size }
    }

    /// Number of values of a plane's margin: the rows above and below with their corners, and the columns left and right.
    pub(in crate::conv) fn len(self) -> usize {
        let (height, width) = self.size;
        2 * (width + 2) + 2 * height
    }

    /// Splits a line of the padded plane, at row `y` and column `x`. `inner` gets the part in the image (its row, column and values),
    /// `margin` the rest (its place in the margins and values).
    pub(in crate::conv) fn split(
        self,
        (y, x): (usize, usize),
        values: &[f32],
        inner: impl FnOnce(usize, usize, &[f32]),
        mut margin: impl FnMut(usize, &[f32]),
    ) {
        let (height, width) = self.size;
        if y == 0 || y == height + 1 {
            return margin(y.min(1) * (width + 2) + x, values);
        }
        let columns = 2 * (width + 2) + y - 1;
        let (mut first, mut last) = (0, values.len());
        if x == 0 {
            first = 1;
            margin(columns, &values[..1]);
        }
        if x + values.len() == width + 2 {
            last -= 1;
            margin(columns + height, &values[last..]);
        }
        inner(y - 1, x + first - 1, &values[first..last]);
    }

    /// Adds a plane's margins to the pixels that they mirror.
    pub(in crate::conv) fn fold(self, margins: &[f32], plane: &mut [f32]) {
        let (height, width) = self.size;
        let (rows, columns) = margins.split_at(2 * (width + 2));
        let mirrored = |i: usize, n: usize| match i {
            0 => 1,
            _ if i == n + 1 => n - 2,
            _ => i - 1,
        };
        for (row, y) in rows.chunks_exact(width + 2).zip([1, height - 2]) {
            for (x, value) in row.iter().enumerate() {
                plane[y * width + mirrored(x, width)] += value;
            }
        }
        for (column, x) in columns.chunks_exact(height).zip([1, width - 2]) {
            for (y, value) in column.iter().enumerate() {
                plane[y * width + x] += value;
            }
        }
    }
}

/// `to[j][t] = line[4·t + j]` for all t.
#[inline(always)]
fn deinterleave(line: &[f32], [a, b, c, d]: [&mut [f32]; 4]) {
    for ((((px, a), b), c), d) in line.as_chunks::<4>().0.iter().zip(a).zip(b).zip(c).zip(d) {
        (*a, *b, *c, *d) = (px[0], px[1], px[2], px[3]);
    }
}

/// `line[4·t + j] = from[j][t]` for all t.
#[inline(always)]
fn interleave([a, b, c, d]: [&[f32]; 4], line: &mut [f32]) {
    let px = line.as_chunks_mut::<4>().0.iter_mut();
    for ((((px, a), b), c), d) in px.zip(a).zip(b).zip(c).zip(d) {
        *px = [*a, *b, *c, *d];
    }
}
