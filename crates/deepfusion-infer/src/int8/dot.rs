//! Sums of products of bytes: each lane adds four inputs times four weights.

use std::arch::x86_64::{
    _mm512_cvtepi32_ps, _mm512_dpbusd_epi32, _mm512_loadu_ps, _mm512_loadu_si512, _mm512_mul_ps,
    _mm512_set1_epi32, _mm512_setzero_si512, _mm512_storeu_ps, _mm512_storeu_si512,
};
use std::ops::Range;

use super::bytes::{ByteImage, Scale, with_bytes};
use crate::Conv;
use crate::aligned::Aligned;
use crate::bf16::{Epilogue, OutputPixel};
use crate::conv::{Geometry, Runs, Tasks, padded_bias, weight};
use crate::element::Bf16;
use crate::scratch::with_scratch;
use crate::tile::{GROUP, LANES};
use crate::view::Shared;

/// Inputs summed before the sums are written to memory, so that their weights stay in the L1 cache.
const INPUTS_AT_ONCE: usize = 384;
/// Output pixels of a task.
const PIXELS_AT_ONCE: usize = 480;
/// Pixels whose sums are kept in registers, with four vectors each.
const ROWS: usize = 6;
/// Inputs that one lane multiplies at once.
const FOUR: usize = 4;
/// The largest weight.
const MOST: f32 = 127.0;
/// A sum of up to this many products of 255 and 127 fits in 32 bits.
const MOST_INPUTS: usize = 65_000;

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct ByteDot {
    geometry: Geometry,
    scale: Scale,
    image: ByteImage,
    runs: Runs,
    /// For each group of [`GROUP`] output channels and four inputs: their weights, channel by channel.
    panels: Aligned<i8>,
    /// Factor of each output channel's sums.
    factors: Vec<f32>,
    bias: Vec<f32>,
}

impl ByteDot {
    /// Whether channels are whole vectors, and sums fit in 32 bits.
    pub(super) fn fits(conv: &Conv, geometry: &Geometry) -> bool {
        let inputs = conv.channels_in * conv.kernel * conv.kernel;
        let whole = geometry.input.channels.is_multiple_of(LANES);
        whole && inputs <= MOST_INPUTS && !geometry.out.result && geometry.out.pixels() > 1
    }

    pub(super) fn new(
        conv: &Conv,
        geometry: Geometry,
        channel_of: &[Option<usize>],
        range: [f32; 2],
    ) -> Self {
        let scale = Scale::of(range);
        let image = ByteImage::new(&geometry);
        let runs = Runs::new(&image.geometry, channel_of, INPUTS_AT_ONCE, FOUR);
        let columns = conv.channels_out.next_multiple_of(LANES);
        let steps: Vec<f32> = (0..columns).map(|o| weight_step(conv, o)).collect();
        let rounded = |o: usize, source| (weight(conv, o, source) / steps[o]).round() as i8;
        let mut panels = Vec::with_capacity(runs.sources.len() * columns);
        for first in (0..columns).step_by(GROUP) {
            for four in runs.sources.chunks(FOUR) {
                for o in first..(first + GROUP).min(columns) {
                    panels.extend(four.iter().map(|source| rounded(o, *source)));
                }
            }
        }
        let factors: Vec<f32> = steps.iter().map(|step| step * scale.step).collect();
        let mut bias = padded_bias(conv, columns);
        for (o, bias) in bias.iter_mut().enumerate() {
            let all = runs.sources.iter().map(|s| i32::from(rounded(o, *s)));
            let shift = i32::from(scale.zero) * all.sum::<i32>();
            *bias -= factors[o] * shift as f32;
        }
        Self {
            geometry,
            scale,
            image,
            runs,
            panels: Aligned::from_slice(&panels),
            factors,
            bias,
        }
    }

    pub(super) fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// # Safety
    /// As for [`crate::conv::ConvForm::run`]; [`super::has_int8`] must be true.
    pub(super) unsafe fn run(&self, arena: Shared<Bf16>) {
        with_bytes(self.image.len, |bytes| {
            // SAFETY: guaranteed by the caller.
            unsafe {
                self.image
                    .fill(arena, &self.geometry.input, self.scale, bytes);
            };
            let bytes = &*bytes;
            let groups = self.bias.len().div_ceil(GROUP);
            Tasks::new(self.geometry.out.pixels(), PIXELS_AT_ONCE, ROWS, groups).run(
                |pixels, groups| {
                    with_scratch(|scratch| {
                        let room = pixels.len().next_multiple_of(ROWS) * GROUP;
                        let sums = scratch.first.take(room);
                        for group in groups {
                            // SAFETY: guaranteed by the caller; each pixel and group belongs to one task.
                            unsafe {
                                self.sum(bytes, group, pixels.clone(), sums);
                                self.finish(arena, group, pixels.clone(), sums);
                            }
                        }
                    });
                },
            );
        });
    }

    fn width(&self, group: usize) -> usize {
        GROUP.min(self.bias.len() - group * GROUP)
    }

    /// The sums of all pixels, [`GROUP`] integers each, stored in the memory of as many floats.
    ///
    /// # Safety
    /// The processor must have the instructions.
    #[target_feature(enable = "avx512f,avx512vnni")]
    unsafe fn sum(&self, bytes: &[u8], group: usize, pixels: Range<usize>, sums: &mut [f32]) {
        let (width, out) = (self.width(group), self.geometry.out.width);
        let panel = &self.panels[group * GROUP * self.runs.sources.len()..];
        let at_once = (INPUTS_AT_ONCE / self.runs.len).max(1);
        for (i, runs) in self.runs.offsets.chunks(at_once).enumerate() {
            let starts = pixels.clone().step_by(ROWS);
            for (start, sums) in starts.zip(sums.chunks_exact_mut(ROWS * GROUP)) {
                // If too few pixels are left, the last one is repeated; those sums are ignored.
                let rows: [*const u8; ROWS] = std::array::from_fn(|r| {
                    let pixel = (start + r).min(pixels.end - 1);
                    let first = self.image.geometry.first_tap(pixel % out, pixel / out);
                    bytes[first..first + self.runs.extent].as_ptr()
                });
                let mut column = 0;
                while column < width {
                    let tile = Tile {
                        rows,
                        runs,
                        len: self.runs.len,
                        panel: panel[i * at_once * self.runs.len * width + FOUR * column..]
                            .as_ptr(),
                        stride: FOUR * width,
                        add: i > 0,
                        sums: sums[column..].as_mut_ptr().cast(),
                    };
                    let vectors = match (width - column) / LANES {
                        4.. => 4,
                        2.. => 2,
                        _ => 1,
                    };
                    // SAFETY: the runs are within their extent; the panel has a row for every four inputs, and the sums have room for every
                    // pixel. The processor has the instructions.
                    unsafe {
                        match vectors {
                            4 => tile.run::<4>(),
                            2 => tile.run::<2>(),
                            _ => tile.run::<1>(),
                        }
                    }
                    column += vectors * LANES;
                }
            }
        }
    }

    /// # Safety
    /// As for [`Self::sum`]; the pixels of the output must be used by this thread only, and nobody may write the residual.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn finish(&self, arena: Shared<Bf16>, group: usize, pixels: Range<usize>, sums: &[f32]) {
        let g = &self.geometry;
        let finish = Epilogue::new(g, &self.bias, arena);
        let places = pixels.map(|p| OutputPixel::new(g, p % g.out.width, p / g.out.width));
        for (place, sums) in places.zip(sums.chunks_exact(GROUP)) {
            for c in (0..self.width(group)).step_by(LANES) {
                let channel = group * GROUP + c;
                let factors = &self.factors[channel..][..LANES];
                let mut products = [0.0_f32; LANES];
                // SAFETY: sixteen sums, factors and products; the rest as above, and the processor has the instructions.
                unsafe {
                    let sums = _mm512_loadu_si512(sums[c..][..LANES].as_ptr().cast());
                    let factors = _mm512_loadu_ps(factors.as_ptr());
                    let scaled = _mm512_mul_ps(_mm512_cvtepi32_ps(sums), factors);
                    _mm512_storeu_ps(products.as_mut_ptr(), scaled);
                    finish.channels(place, channel, products.as_ptr());
                }
            }
        }
    }
}

/// Size of one step of an output channel's weights.
fn weight_step(conv: &Conv, out: usize) -> f32 {
    let inputs = conv.channels_in * conv.kernel * conv.kernel;
    let own = conv.weight.get(out * inputs..(out + 1) * inputs);
    let most = own.unwrap_or_default().iter();
    let most = most.fold(0.0_f32, |most, w| most.max(w.abs()));
    if most > 0.0 { most / MOST } else { 1.0 }
}

/// [`ROWS`] pixels by a few vectors of output channels.
struct Tile<'a> {
    rows: [*const u8; ROWS],
    runs: &'a [usize],
    len: usize,
    panel: *const i8,
    /// Weights of a row of the panel.
    stride: usize,
    /// Whether to add to the existing sums.
    add: bool,
    /// Distance from one pixel's sums to the next pixel's: [`GROUP`].
    sums: *mut i32,
}

impl Tile<'_> {
    /// # Safety
    /// The runs must be readable, the panel as long as they are, the sums writable; the processor must have the
    /// instructions.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    unsafe fn run<const V: usize>(self) {
        let mut sums = [[_mm512_setzero_si512(); V]; ROWS];
        // SAFETY: reads and writes are valid (guaranteed by the caller).
        unsafe {
            if self.add {
                for r in 0..ROWS {
                    for v in 0..V {
                        let at = self.sums.add(r * GROUP + v * LANES);
                        sums[r][v] = _mm512_loadu_si512(at.cast());
                    }
                }
            }
            let mut panel = self.panel;
            for &run in self.runs {
                for k in (run..run + self.len).step_by(FOUR) {
                    let mut weights = [_mm512_setzero_si512(); V];
                    for v in 0..V {
                        weights[v] = _mm512_loadu_si512(panel.add(v * FOUR * LANES).cast());
                    }
                    panel = panel.add(self.stride);
                    for r in 0..ROWS {
                        let four = self.rows[r].add(k).cast::<i32>().read_unaligned();
                        let four = _mm512_set1_epi32(four);
                        for v in 0..V {
                            sums[r][v] = _mm512_dpbusd_epi32(sums[r][v], four, weights[v]);
                        }
                    }
                }
            }
            for r in 0..ROWS {
                for v in 0..V {
                    let at = self.sums.add(r * GROUP + v * LANES);
                    _mm512_storeu_si512(at.cast(), sums[r][v]);
                }
            }
        }
    }
}
