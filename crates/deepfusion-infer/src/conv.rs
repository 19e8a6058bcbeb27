//! The trait of all forms of a convolution, and what they share: the geometry on views, the runs of inputs, and the division into tasks.

use std::ops::Range;

use rayon::prelude::*;

use crate::view::{Shared, View};
use crate::{Activation, Border, Conv};

/// A convolution ready to run on values stored as `E`.
pub(crate) trait ConvForm<E> {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self;

    /// Number of elements that it may read beyond the last pixel of a buffer whose pixels are `pitch` elements apart.
    fn overread(pitch: usize) -> usize;

    /// Its name in profiles.
    fn name(&self) -> &'static str;

    fn geometry(&self) -> &Geometry;

    /// Its runs, if it also reads elements that are none of its inputs (`None` as a source). A form's results depend only on its inputs and
    /// the elements listed here.
    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)>;

    /// # Safety
    /// `arena` must contain every view of the geometry, with its border and `overread` elements beyond its buffer. Nobody else may use the
    /// output during the call, or write the others.
    unsafe fn run(&self, arena: Shared<E>);
}

/// A convolution's place in the arena.
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub(crate) input: View,
    pub(crate) out: View,
    pub(crate) residual: Option<View>,
    pub(crate) kernel: usize,
    pub(crate) stride: usize,
    pub(crate) dilation: usize,
    pub(crate) border: Border,
    pub(crate) activation: Activation,
    /// The range of the input that int8 divides into steps, if it is to be computed in int8.
    pub(crate) input_range: Option<[f32; 2]>,
}

impl Geometry {
    /// Offset of the first tap of output pixel (0, 0).
    pub(crate) fn corner(&self) -> usize {
        let reach = self.kernel / 2 * self.dilation;
        self.input.offset - reach * (self.input.row + self.input.pitch)
    }

    /// Offset of the first tap of an output pixel.
    pub(crate) fn first_tap(&self, x: usize, y: usize) -> usize {
        self.corner() + self.stride * (y * self.input.row + x * self.input.pitch)
    }

    /// Whether the tap at index `k`, along an axis of `n` pixels, ever reads a pixel: a wide kernel's outermost taps may read nothing but
    /// the zeros of the border.
    fn reads_a_pixel(&self, k: usize, n: usize) -> bool {
        let off = k.abs_diff(self.kernel / 2) * self.dilation;
        self.border == Border::Reflect || off < n
    }

    /// The kernel's rows with taps that ever read a pixel.
    fn tap_rows(&self) -> impl Iterator<Item = usize> {
        (0..self.kernel).filter(|ky| self.reads_a_pixel(*ky, self.input.height))
    }

    /// Number of taps that ever read a pixel.
    pub(crate) fn taps(&self) -> usize {
        let columns = (0..self.kernel).filter(|kx| self.reads_a_pixel(*kx, self.input.width));
        self.tap_rows().count() * columns.count()
    }

    /// Distance from a pixel's first tap to another tap.
    fn tap(&self, ky: usize, kx: usize) -> usize {
        self.dilation * (ky * self.input.row + kx * self.input.pitch)
    }
}

/// All pixels from one on, row by row, as x and y. It divides for the first of them only.
#[cfg(target_arch = "x86_64")]
pub(crate) fn pixels_from(first: usize, width: usize) -> impl Iterator<Item = (usize, usize)> {
    let (mut x, mut y) = (first % width, first / width);
    std::iter::repeat_with(move || {
        let pixel = (x, y);
        x += 1;
        if x == width {
            (x, y) = (0, y + 1);
        }
        pixel
    })
}

/// Runs of one output pixel's inputs, each contiguous in memory.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Runs {
    /// Start of each run, relative to the first tap of the output pixel.
    pub(crate) offsets: Vec<usize>,
    /// Elements of each run.
    pub(crate) len: usize,
    /// Elements from the first tap of a pixel to the end of the last run.
    pub(crate) extent: usize,
    /// For each run and element: its input channel and tap (ky·kernel + kx); `None` for padding.
    pub(crate) sources: Vec<Option<(usize, usize)>>,
}

impl Runs {
    /// Whether some of the elements are padding.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn read_on(&self) -> bool {
        self.sources.iter().any(Option::is_none)
    }

    /// The runs of a convolution over a view, of which `channel_of` maps physical to logical channels. Their length is a multiple of
    /// `multiple` and at most `most`; each is padded by less than `multiple`.
    pub(crate) fn new(
        g: &Geometry,
        channel_of: &[Option<usize>],
        most: usize,
        multiple: usize,
    ) -> Self {
        let channels = channel_of.len();
        // If there are no gaps between pixels' channels, a row of the kernel is one run.
        let neighbours = channels == g.input.pitch && g.dilation == 1;
        let joined = if neighbours { g.kernel } else { 1 };
        let whole = channels * joined;
        let mut runs = Self::empty(run_length(whole, most, multiple));
        let len = runs.len;
        for ky in g.tap_rows() {
            for kx in (0..g.kernel).step_by(joined) {
                if joined == 1 && !g.reads_a_pixel(kx, g.input.width) {
                    continue;
                }
                for part in 0..whole.div_ceil(len) {
                    runs.offsets.push(g.tap(ky, kx) + part * len);
                    for k in part * len..(part + 1) * len {
                        let tap = ky * g.kernel + kx + k / channels;
                        let channel = if k < whole {
                            channel_of[k % channels]
                        } else {
                            None
                        };
                        runs.sources.push(channel.map(|c| (c, tap)));
                    }
                }
            }
        }
        runs.measured()
    }

    /// Runs of `len` channels each, ordered so that all taps of the same channels are adjacent: neighbouring taps read the same pixels,
    /// which are then still in the L1 cache.
    pub(crate) fn by_channels(g: &Geometry, channel_of: &[Option<usize>], len: usize) -> Self {
        let mut runs = Self::empty(len);
        for first in (0..channel_of.len()).step_by(len) {
            for ky in g.tap_rows() {
                for kx in (0..g.kernel).filter(|kx| g.reads_a_pixel(*kx, g.input.width)) {
                    runs.offsets.push(g.tap(ky, kx) + first);
                    let tap = ky * g.kernel + kx;
                    let channel = |c: usize| channel_of.get(c).copied().flatten();
                    let sources = (first..first + len).map(|c| channel(c).map(|c| (c, tap)));
                    runs.sources.extend(sources);
                }
            }
        }
        runs.measured()
    }

    fn empty(len: usize) -> Self {
        Self {
            offsets: Vec::new(),
            len,
            extent: 0,
            sources: Vec::new(),
        }
    }

    fn measured(mut self) -> Self {
        self.extent = self.offsets.iter().max().map_or(0, |last| last + self.len);
        self
    }
}

/// The length of equal runs, at most `most` and a multiple of `multiple`, into which `whole` elements are cut, so that only the last
/// multiple is padded.
fn run_length(whole: usize, most: usize, multiple: usize) -> usize {
    let units = whole.div_ceil(multiple);
    let mut lengths = (1..=(most / multiple).min(units)).rev();
    let length = lengths.find(|length| units.is_multiple_of(*length));
    length.unwrap_or(1) * multiple
}

/// One weight of a convolution; 0 for padding.
pub(crate) fn weight(conv: &Conv, out: usize, source: Option<(usize, usize)>) -> f32 {
    match source {
        Some((channel, tap)) if out < conv.channels_out => {
            let taps = conv.kernel * conv.kernel;
            conv.weight[(out * conv.channels_in + channel) * taps + tap]
        }
        _ => 0.0,
    }
}

/// The bias, padded with zeros.
pub(crate) fn padded_bias(conv: &Conv, channels: usize) -> Vec<f32> {
    let mut bias = conv.bias.clone();
    bias.resize(channels, 0.0);
    bias
}

/// `pixels` × `groups` divided into tasks of about `most` pixels each, and of fewer groups if there would otherwise be too few tasks for
/// the threads.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tasks {
    pixels: usize,
    piece: usize,
    pieces: usize,
    groups: usize,
    parts: usize,
}

impl Tasks {
    /// Pixels are divided at multiples of `multiple`.
    pub(crate) fn new(pixels: usize, most: usize, multiple: usize, groups: usize) -> Self {
        let even = pixels.div_ceil(pixels.div_ceil(most));
        let piece = even.next_multiple_of(multiple);
        let pieces = pixels.div_ceil(piece);
        let wanted = 2 * rayon::current_num_threads();
        Self {
            pixels,
            piece,
            pieces,
            groups,
            parts: wanted.div_ceil(pieces).min(groups),
        }
    }

    /// Runs every task with its pixels and its groups.
    pub(crate) fn run(self, task: impl Fn(Range<usize>, Range<usize>) + Sync) {
        (0..self.pieces * self.parts).into_par_iter().for_each(|i| {
            let (part, start) = (i / self.pieces, i % self.pieces * self.piece);
            let group = |part: usize| part * self.groups / self.parts;
            let pixels = start..(start + self.piece).min(self.pixels);
            task(pixels, group(part)..group(part + 1));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_have_equal_lengths_and_as_little_padding_as_possible() {
        assert_eq!(run_length(1536, 160, 1), 128);
        assert_eq!(run_length(288, 160, 1), 144);
        assert_eq!(run_length(21, 160, 1), 21);
        assert_eq!(run_length(21, 320, 2), 22);
        assert_eq!(run_length(21, usize::MAX, 32), 32);
        for (whole, most, multiple) in [(672, 160, 1), (2048, 320, 2), (163, 160, 1), (75, 64, 2)] {
            let len = run_length(whole, most, multiple);
            assert!(len <= most && len.is_multiple_of(multiple), "{whole}");
            assert!(
                whole.next_multiple_of(multiple).is_multiple_of(len),
                "{whole}"
            );
        }
    }
}
