//! Convolutions to one channel in bf16. Vectors run along the inputs; the other forms would waste fifteen of sixteen lanes.

use std::arch::x86_64::{
    __m512bh, __m512i, __mmask32, _mm512_dpbf16_ps, _mm512_loadu_si512, _mm512_maskz_loadu_epi16,
    _mm512_reduce_add_ps, _mm512_setzero_ps,
};
use std::mem::transmute;

use rayon::prelude::*;

use super::{Epilogue, OutputPixel};
use crate::Conv;
use crate::aligned::Aligned;
use crate::conv::{Geometry, Runs, weight};
use crate::element::{Bf16, Element};
use crate::tile::LANES;
use crate::view::Shared;

/// Inputs of a vector.
const INPUTS: usize = 32;

/// A convolution to one channel, ready to run.
#[derive(Debug)]
pub(crate) struct HeadDot {
    geometry: Geometry,
    runs: Runs,
    /// One weight for every input of every run; each run is padded to whole vectors.
    weights: Aligned<Bf16>,
    /// Number of inputs in a run's last vector.
    last: __mmask32,
    bias: [f32; LANES],
}

impl HeadDot {
    /// # Panics
    /// If there is more than one output channel.
    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        assert_eq!(conv.channels_out, 1, "a head has one channel");
        let runs = Runs::new(&geometry, channel_of, usize::MAX, 1);
        let mut weights = Vec::new();
        for run in runs.sources.chunks(runs.len) {
            weights.extend(run.iter().map(|source| Bf16::of(weight(conv, 0, *source))));
            weights.resize(weights.len().next_multiple_of(INPUTS), Bf16::default());
        }
        let rest = runs.len - (runs.len - 1) / INPUTS * INPUTS;
        Self {
            geometry,
            weights: Aligned::from_slice(&weights),
            last: u32::MAX >> (INPUTS - rest),
            runs,
            bias: [conv.bias[0]; LANES],
        }
    }

    pub(crate) fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// # Safety
    /// As for [`crate::conv::ConvForm::run`]; the processor must have the instructions.
    pub(crate) unsafe fn run(&self, arena: Shared<Bf16>) {
        (0..self.geometry.out.height).into_par_iter().for_each(|y| {
            // SAFETY: guaranteed by the caller; each row belongs to one task.
            unsafe { self.row(arena, y) };
        });
    }

    /// # Safety
    /// As for [`Self::run`], and the row of the output must be used by this thread only.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn row(&self, arena: Shared<Bf16>, y: usize) {
        let g = &self.geometry;
        let finish = Epilogue::new(g, &self.bias, arena);
        let (corner, step) = (g.first_tap(0, y), g.stride * g.input.pitch);
        // Including the row's last pixel.
        let row = arena.at(corner, (g.out.width - 1) * step + self.runs.extent);
        for first in (0..g.out.width).step_by(LANES) {
            let count = LANES.min(g.out.width - first);
            let mut places = [None; LANES];
            let mut sums = [0.0_f32; LANES];
            for (i, (place, sum)) in places.iter_mut().zip(&mut sums).enumerate().take(count) {
                *place = Some(OutputPixel::new(g, first + i, y));
                // SAFETY: the runs are within the row, as was just checked, and nobody writes it (guaranteed by the caller).
                *sum = unsafe { self.sum(row.add((first + i) * step)) };
            }
            // SAFETY: the pixels are used by this thread only (guaranteed by the caller).
            unsafe { finish.results(&places, |i| sums[i]) };
        }
    }

    /// # Safety
    /// The runs from `pixel` on must be readable; the processor must have the instructions.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512bf16")]
    unsafe fn sum(&self, pixel: *const Bf16) -> f32 {
        let mut sum = _mm512_setzero_ps();
        let mut weights = self.weights.as_ptr();
        let bits = |bits: __m512i| {
            // SAFETY: a vector of pairs has the same bits as one of integers.
            unsafe { transmute::<__m512i, __m512bh>(bits) }
        };
        for &run in &self.runs.offsets {
            let whole = (self.runs.len - 1) / INPUTS * INPUTS;
            // SAFETY: the pixel is readable (guaranteed by the caller), and the last vector is read only as far as the run. There are as
            // many weights as the vectors have inputs.
            unsafe {
                for k in (0..whole).step_by(INPUTS) {
                    let x = _mm512_loadu_si512(pixel.add(run + k).cast());
                    let w = _mm512_loadu_si512(weights.cast());
                    sum = _mm512_dpbf16_ps(sum, bits(x), bits(w));
                    weights = weights.add(INPUTS);
                }
                let x = _mm512_maskz_loadu_epi16(self.last, pixel.add(run + whole).cast());
                let w = _mm512_loadu_si512(weights.cast());
                sum = _mm512_dpbf16_ps(sum, bits(x), bits(w));
                weights = weights.add(INPUTS);
            }
        }
        _mm512_reduce_add_ps(sum)
    }
}
