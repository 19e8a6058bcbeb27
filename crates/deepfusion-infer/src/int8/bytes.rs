//! A convolution's input as bytes.

use std::arch::x86_64::{
    _mm_storeu_si128, _mm256_loadu_si256, _mm512_castsi512_ps, _mm512_cvtepu16_epi32,
    _mm512_cvtps_epi32, _mm512_cvtusepi32_epi8, _mm512_fmadd_ps, _mm512_max_ps, _mm512_min_ps,
    _mm512_set1_ps, _mm512_setzero_ps, _mm512_slli_epi32,
};
use std::cell::RefCell;

use rayon::prelude::*;

use crate::conv::Geometry;
use crate::element::Bf16;
use crate::tile::LANES;
use crate::view::{Shared, View};

/// The largest byte.
const STEPS: f32 = 255.0;

/// Conversion of values to bytes: q = x / `step` + `zero`, rounded and limited to a byte.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) step: f32,
    pub(super) zero: u8,
}

impl Scale {
    /// The scale of a range. It is extended to include 0, which then has an exact byte: a border of zeros consists of `zero`.
    pub(super) fn of([low, high]: [f32; 2]) -> Self {
        let (low, high) = (low.min(0.0), high.max(0.0));
        // For values that are all 0.
        let step = if high > low {
            (high - low) / STEPS
        } else {
            1.0
        };
        Self {
            step,
            zero: (-low / step).round().clamp(0.0, STEPS) as u8,
        }
    }
}

/// The input of a convolution as bytes: without gaps between pixels, with as wide a border as the kernel needs.
#[derive(Debug, Clone)]
pub(super) struct ByteImage {
    /// The same convolution on the bytes.
    pub(super) geometry: Geometry,
    /// Distance in pixels between those that are read.
    every: usize,
    pub(super) len: usize,
}

impl ByteImage {
    pub(super) fn new(geometry: &Geometry) -> Self {
        let input = &geometry.input;
        let reach = geometry.kernel / 2 * geometry.dilation;
        // A single tap skips the pixels in between.
        let every = if geometry.kernel == 1 {
            geometry.stride
        } else {
            1
        };
        let (width, height) = (input.width.div_ceil(every), input.height.div_ceil(every));
        let row = (width + 2 * reach) * input.channels;
        let view = View {
            offset: reach * (row + input.channels),
            row,
            pitch: input.channels,
            width,
            height,
            border: reach,
            ..*input
        };
        Self {
            geometry: Geometry {
                input: view,
                stride: geometry.stride / every,
                ..geometry.clone()
            },
            every,
            len: (height + 2 * reach) * row,
        }
    }

    /// Writes the input of a convolution as bytes.
    ///
    /// # Safety
    /// `input` and its border must be in the arena, and nobody may write them; the processor must have AVX-512.
    pub(super) unsafe fn fill(
        &self,
        arena: Shared<Bf16>,
        input: &View,
        scale: Scale,
        bytes: &mut [u8],
    ) {
        let View {
            border: reach,
            width,
            row: row_len,
            ..
        } = self.geometry.input;
        let pixels = width + 2 * reach;
        let first = input.offset - reach * (input.row + input.pitch);
        // Without gaps a row is contiguous.
        let joined = input.pitch == input.channels && self.every == 1;
        let rows = bytes[..self.len].par_chunks_mut(row_len).enumerate();
        rows.for_each(|(y, row)| {
            let start = first + y * self.every * input.row;
            let piece = if joined {
                pixels * input.channels
            } else {
                input.channels
            };
            for (x, to) in row.chunks_exact_mut(piece).enumerate() {
                let from = arena.at(start + x * self.every * input.pitch, piece);
                // SAFETY: as many values as bytes, which nobody writes (guaranteed by the caller).
                unsafe { to_bytes(from, scale, to) };
            }
        });
    }
}

/// # Safety
/// `from` must have as many values as `to`, a multiple of [`LANES`]; the processor must have AVX-512.
#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
unsafe fn to_bytes(from: *const Bf16, scale: Scale, to: &mut [u8]) {
    let inverse = _mm512_set1_ps(scale.step.recip());
    let zero = _mm512_set1_ps(f32::from(scale.zero));
    let most = _mm512_set1_ps(STEPS);
    for (i, to) in to.chunks_exact_mut(LANES).enumerate() {
        // SAFETY: sixteen values and sixteen bytes.
        unsafe {
            let bits = _mm256_loadu_si256(from.add(i * LANES).cast());
            let value = _mm512_castsi512_ps(_mm512_slli_epi32::<16>(_mm512_cvtepu16_epi32(bits)));
            let steps = _mm512_fmadd_ps(value, inverse, zero);
            // NaN, for which bytes have no value, becomes the smallest one.
            let steps = _mm512_min_ps(_mm512_max_ps(steps, _mm512_setzero_ps()), most);
            let bytes = _mm512_cvtusepi32_epi8(_mm512_cvtps_epi32(steps));
            _mm_storeu_si128(to.as_mut_ptr().cast(), bytes);
        }
    }
}

/// Lends `len` bytes that the thread keeps from image to image. During the call they are moved out of the thread's storage, because a
/// thread that waits for its tasks may run another engine's.
pub(super) fn with_bytes<R>(len: usize, work: impl FnOnce(&mut [u8]) -> R) -> R {
    thread_local! {
        static BYTES: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    }
    let mut bytes = BYTES.take();
    if bytes.len() < len {
        bytes.resize(len, 0);
    }
    let result = work(&mut bytes);
    BYTES.set(bytes);
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;

    #[test]
    fn zero_has_an_exact_byte_in_every_range() {
        for range in [[-1.0, 3.0], [0.5, 2.0], [-4.0, -1.0], [0.0, 0.0]] {
            let scale = Scale::of(range);
            assert!(scale.step > 0.0, "{range:?}");
            // One step is a 255th of the range extended to 0.
            let all = range[1].max(0.0) - range[0].min(0.0);
            assert!((scale.step * 255.0 - all).abs() < 1e-6 || all == 0.0);
        }
        assert_eq!(Scale::of([-1.0, 3.0]).zero, 64);
        assert_eq!(Scale::of([0.5, 2.0]).zero, 0);
        assert_eq!(Scale::of([-4.0, -1.0]).zero, 255);
    }

    #[test]
    fn values_are_rounded_and_limited_to_a_byte() {
        if !super::super::has_int8() {
            return;
        }
        let scale = Scale::of([-1.0, 1.55]);
        let values = [-9.0, -1.0, -0.012, 0.0, 0.004, 0.02, 1.55, 1e30, f32::NAN];
        let mut from = [Bf16::default(); LANES];
        for (place, value) in from.iter_mut().zip(values) {
            *place = Bf16::of(value);
        }
        let mut to = [0_u8; LANES];
        // SAFETY: sixteen of each, and the processor was checked.
        unsafe { to_bytes(from.as_ptr(), scale, &mut to) };
        // In steps of 0.01 from 100 on; 1.55 is 1.546875 in bf16.
        assert_eq!(to[..9], [0, 0, 99, 100, 100, 102, 255, 255, 0]);
    }
}
