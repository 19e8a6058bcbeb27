//! Convolutions in bf16 with AVX-512's dot products: each lane adds the products of a pair of inputs.

use std::arch::x86_64::{
    __m512bh, __m512i, _mm512_dpbf16_ps, _mm512_loadu_ps, _mm512_loadu_si512, _mm512_set1_epi32,
    _mm512_setzero_ps, _mm512_storeu_ps,
};
use std::mem::transmute;

use super::{Epilogue, OutputPixel};
use crate::Conv;
use crate::aligned::Aligned;
use crate::conv::{ConvForm, Geometry, Runs, Tasks, padded_bias, pixels_from, weight};
use crate::element::{Bf16, Element};
use crate::scratch::with_scratch;
use crate::tile::{GROUP, LANES};
use crate::view::Shared;

/// Inputs summed before the sums are written to memory, so that their weights stay in the L1 cache.
pub(super) const INPUTS_AT_ONCE: usize = 320;
/// Output pixels of a task.
const PIXELS_AT_ONCE: usize = 480;
/// Pixels whose sums are kept in registers, with two vectors each.
pub(super) const ROWS: usize = 6;
/// The same with a single vector each: with fewer sums, additions would wait for each other's latency.
const NARROW_ROWS: usize = 2 * ROWS;

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct Dot {
    geometry: Geometry,
    runs: Runs,
    /// For each group of [`GROUP`] output channels and pair of inputs: the pair's weights, channel by channel.
    panels: Aligned<Bf16>,
    bias: Vec<f32>,
}

impl ConvForm<Bf16> for Dot {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        let runs = Runs::new(&geometry, channel_of, INPUTS_AT_ONCE, 2);
        let columns = conv.channels_out.next_multiple_of(LANES);
        let mut panels = Vec::with_capacity(runs.sources.len() * columns);
        for first in (0..columns).step_by(GROUP) {
            for pair in runs.sources.chunks(2) {
                for o in first..(first + GROUP).min(columns) {
                    panels.extend(pair.iter().map(|s| Bf16::of(weight(conv, o, *s))));
                }
            }
        }
        Self {
            bias: padded_bias(conv, columns),
            geometry,
            runs,
            panels: Aligned::from_slice(&panels),
        }
    }

    /// The missing second of a pair.
    fn overread(_: usize) -> usize {
        1
    }

    fn name(&self) -> &'static str {
        "dot"
    }

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        let own = (&self.geometry, &self.runs);
        self.runs.read_on().then_some(own)
    }

    /// # Safety
    /// As for the trait; the processor must have the instructions.
    unsafe fn run(&self, arena: Shared<Bf16>) {
        let groups = self.bias.len().div_ceil(GROUP);
        Tasks::new(
            self.geometry.out.pixels(),
            PIXELS_AT_ONCE,
            NARROW_ROWS,
            groups,
        )
        .run(|pixels, groups| {
            with_scratch(|scratch| {
                let sums = scratch
                    .first
                    .take(pixels.len().next_multiple_of(NARROW_ROWS) * GROUP);
                for group in groups {
                    // SAFETY: guaranteed by the caller; each pixel and group belongs to one task.
                    unsafe {
                        self.sum(arena, group, pixels.clone(), sums);
                        self.finish(arena, group, pixels.clone(), sums);
                    }
                }
            });
        });
    }
}

impl Dot {
    fn width(&self, group: usize) -> usize {
        GROUP.min(self.bias.len() - group * GROUP)
    }

    /// The sums of all pixels, [`GROUP`] values each.
    ///
    /// # Safety
    /// As for [`ConvForm::run`]; the processor must have the instructions.
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn sum(
        &self,
        arena: Shared<Bf16>,
        group: usize,
        pixels: std::ops::Range<usize>,
        sums: &mut [f32],
    ) {
        // SAFETY: guaranteed by the caller.
        unsafe {
            if self.width(group) > LANES {
                self.sum_by::<ROWS>(arena, group, pixels, sums);
            } else {
                self.sum_by::<NARROW_ROWS>(arena, group, pixels, sums);
            }
        }
    }

    /// Like [`Self::sum`], `R` pixels at a time.
    ///
    /// # Safety
    /// As for [`Self::sum`].
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn sum_by<const R: usize>(
        &self,
        arena: Shared<Bf16>,
        group: usize,
        pixels: std::ops::Range<usize>,
        sums: &mut [f32],
    ) {
        let width = self.width(group);
        let panel = &self.panels[group * GROUP * self.runs.sources.len()..];
        let at_once = (INPUTS_AT_ONCE / self.runs.len).max(1);
        for (i, runs) in self.runs.offsets.chunks(at_once).enumerate() {
            let mut inputs = pixels_from(pixels.start, self.geometry.out.width)
                .take(pixels.len())
                .map(|(x, y)| arena.at(self.geometry.first_tap(x, y), self.runs.extent))
                .peekable();
            let Some(first) = inputs.peek() else { return };
            let mut rows = [first.cast_const(); R];
            for sums in sums.chunks_mut(R * GROUP).take(pixels.len().div_ceil(R)) {
                // If too few pixels are left, some before them are repeated; those sums are ignored.
                for (row, input) in rows.iter_mut().zip(&mut inputs) {
                    *row = input.cast_const();
                }
                for column in (0..width).step_by(2 * LANES) {
                    let tile = Tile {
                        rows,
                        runs,
                        len: self.runs.len,
                        panel: panel[i * at_once * self.runs.len * width + 2 * column..].as_ptr(),
                        stride: 2 * width,
                        add: i > 0,
                        sums: sums[column..].as_mut_ptr(),
                        pitch: GROUP,
                    };
                    // SAFETY: the runs are within their extent, which is in the arena and which nobody writes (the contract of `run`),
                    // except for the elements read beyond the inputs. The panel has a row for every pair of inputs, and the sums have room
                    // for every pixel. The processor has the instructions.
                    unsafe {
                        if width - column >= 2 * LANES {
                            tile.run::<2>();
                        } else {
                            tile.run::<1>();
                        }
                    }
                }
            }
        }
    }

    /// # Safety
    /// As for [`Self::sum`], and the pixels of the output must be used by this thread only.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn finish(
        &self,
        arena: Shared<Bf16>,
        group: usize,
        pixels: std::ops::Range<usize>,
        sums: &[f32],
    ) {
        let g = &self.geometry;
        let finish = Epilogue::new(g, &self.bias, arena);
        if g.out.result {
            let place = |p: usize| OutputPixel::new(g, p % g.out.width, p / g.out.width);
            for first in pixels.clone().step_by(LANES) {
                let inside = |p: &usize| *p < pixels.end;
                let places = std::array::from_fn::<_, LANES, _>(|i| {
                    Some(first + i).filter(inside).map(place)
                });
                let sum = |i: usize| sums.get((first + i - pixels.start) * GROUP).copied();
                // SAFETY: the pixels are used by this thread only (guaranteed by the caller).
                unsafe { finish.results(&places, |i| sum(i).unwrap_or(0.0)) };
            }
            return;
        }
        let places = pixels_from(pixels.start, g.out.width).take(pixels.len());
        for ((x, y), sums) in places.zip(sums.chunks(GROUP)) {
            let place = OutputPixel::new(g, x, y);
            for c in (0..self.width(group)).step_by(LANES) {
                let sums = &sums[c..][..LANES];
                // SAFETY: sixteen sums; the rest as above, and the processor has the instructions.
                unsafe { finish.channels(place, group * GROUP + c, sums.as_ptr()) };
            }
        }
    }
}

/// `R` pixels by a few vectors of output channels.
pub(super) struct Tile<'a, const R: usize> {
    pub(super) rows: [*const Bf16; R],
    pub(super) runs: &'a [usize],
    pub(super) len: usize,
    pub(super) panel: *const Bf16,
    /// Elements of a row of the panel.
    pub(super) stride: usize,
    /// Whether to add to the existing sums.
    pub(super) add: bool,
    pub(super) sums: *mut f32,
    /// Distance from one pixel's sums to the next pixel's.
    pub(super) pitch: usize,
}

impl<const R: usize> Tile<'_, R> {
    /// # Safety
    /// The runs must be readable, the panel as long as they are, the sums writable; the processor must have the
    /// instructions.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bf16")]
    pub(super) unsafe fn run<const V: usize>(self) {
        let mut sums = [[_mm512_setzero_ps(); V]; R];
        // SAFETY: reads and writes are valid (guaranteed by the caller). A pair of bf16 has 32 bits; a vector of pairs has the same bits as
        // one of integers.
        unsafe {
            if self.add {
                for r in 0..R {
                    for v in 0..V {
                        sums[r][v] = _mm512_loadu_ps(self.sums.add(r * self.pitch + v * LANES));
                    }
                }
            }
            let mut panel = self.panel;
            for &run in self.runs {
                for k in (run..run + self.len).step_by(2) {
                    let mut weights = [_mm512_set1_epi32(0); V];
                    for v in 0..V {
                        weights[v] = _mm512_loadu_si512(panel.add(2 * v * LANES).cast());
                    }
                    panel = panel.add(self.stride);
                    for r in 0..R {
                        let pair = self.rows[r].add(k).cast::<i32>().read_unaligned();
                        let pair = _mm512_set1_epi32(pair);
                        for v in 0..V {
                            sums[r][v] = _mm512_dpbf16_ps(
                                sums[r][v],
                                transmute::<__m512i, __m512bh>(pair),
                                transmute::<__m512i, __m512bh>(weights[v]),
                            );
                        }
                    }
                }
            }
            for r in 0..R {
                for v in 0..V {
                    _mm512_storeu_ps(self.sums.add(r * self.pitch + v * LANES), sums[r][v]);
                }
            }
        }
    }
}
