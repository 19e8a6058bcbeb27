//! Both products with AVX-512's dot products of pairs: a word of the row, broadcast to all lanes, times sixteen words of the columns.

use super::{PixelPairs, ROWS, TapPairs};
use std::arch::x86_64::{
    __m512, __m512bh, __m512i, _mm512_dpbf16_ps, _mm512_loadu_ps, _mm512_loadu_si512,
    _mm512_set1_epi32, _mm512_setzero_ps, _mm512_storeu_ps,
};
use std::mem::transmute;
use std::ops::Range;

/// Number of rows whose sums are kept in registers.
const HEIGHT: usize = 8;
/// Number of lanes of a vector.
const LANES: usize = 16;
/// Steps summed before the sums are written to memory, so that the rows' factors stay in the L1 cache.
const STEPS_AT_ONCE: usize = 18;
/// Pairs of pixels at once, so that the columns' factors, which all channels and taps multiply, stay in the L1 cache.
const PIXEL_PAIRS_AT_ONCE: usize = 128;

pub(super) fn available() -> bool {
    is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bf16")
}

/// Sums of [`HEIGHT`] rows by `V` vectors of columns.
struct Sums<const V: usize>([[__m512; V]; HEIGHT]);

impl<const V: usize> Sums<V> {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bf16")]
    fn zero() -> Self {
        Self([[_mm512_setzero_ps(); V]; HEIGHT])
    }

    /// # Safety
    /// All rows of `from`, `stride` floats apart, must be readable.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn load(from: *const f32, stride: usize) -> Self {
        let mut sums = Self::zero();
        for row in 0..HEIGHT {
            for v in 0..V {
                // SAFETY: guaranteed by the caller.
                sums.0[row][v] = unsafe { _mm512_loadu_ps(from.add(row * stride + v * LANES)) };
            }
        }
        sums
    }

    /// # Safety
    /// As for [`Self::load`]; they must also be writable.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn store(&self, to: *mut f32, stride: usize) {
        for row in 0..HEIGHT {
            for v in 0..V {
                // SAFETY: guaranteed by the caller.
                unsafe { _mm512_storeu_ps(to.add(row * stride + v * LANES), self.0[row][v]) };
            }
        }
    }

    /// Adds the products of each row's word (`stride` bytes from one row to the next) and the columns' words.
    ///
    /// # Safety
    /// Every row's word, at any alignment, and the columns' words must be readable.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn add(&mut self, rows: *const u8, stride: usize, columns: *const u32) {
        let mut factors = [_mm512_set1_epi32(0); V];
        for v in 0..V {
            // SAFETY: guaranteed by the caller.
            factors[v] = unsafe { _mm512_loadu_si512(columns.add(v * LANES).cast()) };
        }
        for row in 0..HEIGHT {
            // SAFETY: guaranteed by the caller. A vector of pairs has the same bits as one of integers.
            unsafe {
                let word = _mm512_set1_epi32(rows.add(row * stride).cast::<i32>().read_unaligned());
                for v in 0..V {
                    self.0[row][v] = _mm512_dpbf16_ps(
                        self.0[row][v],
                        transmute::<__m512i, __m512bh>(word),
                        transmute::<__m512i, __m512bh>(factors[v]),
                    );
                }
            }
        }
    }
}

/// # Safety
/// The processor must have the instructions; bounds must be as [`TapPairs::run`] checks them.
#[target_feature(enable = "avx512f,avx512bf16")]
pub(super) unsafe fn taps(product: TapPairs) {
    let TapPairs {
        weights,
        offsets,
        pairs,
        plane_len,
        source,
        columns,
        out,
        rows,
    } = product;
    let tile = ROWS * pairs;
    let block = offsets.len() * tile;
    for (index, steps) in offsets.chunks(STEPS_AT_ONCE).enumerate() {
        let first_step = index * STEPS_AT_ONCE;
        for row in (0..rows).step_by(HEIGHT) {
            let of_rows = row / ROWS * block + first_step * tile + row % ROWS * pairs;
            for column in (0..columns).step_by(2 * LANES) {
                // SAFETY: guaranteed by the caller.
                unsafe {
                    let to = out.as_mut_ptr().add(row * columns + column);
                    let mut sums = if index > 0 {
                        Sums::<2>::load(to, columns)
                    } else {
                        Sums::zero()
                    };
                    for (step, offset) in steps.iter().enumerate() {
                        let words = weights.as_ptr().add(of_rows + step * tile);
                        let from = source.as_ptr().add(offset + column);
                        for p in 0..pairs {
                            sums.add(words.add(p).cast(), 4 * pairs, from.add(p * plane_len));
                        }
                    }
                    sums.store(to, columns);
                }
            }
        }
    }
}

/// # Safety
/// The processor must have the instructions; bounds must be as [`PixelPairs::run`] checks them.
#[target_feature(enable = "avx512f,avx512bf16")]
pub(super) unsafe fn pixels(product: PixelPairs) {
    let outputs = product.outputs;
    let wide = outputs / (2 * LANES) * (2 * LANES);
    // SAFETY: guaranteed by the caller.
    unsafe {
        let PixelPairs {
            offsets,
            plane_len,
            channels,
            source,
            pixels,
            grad,
            outputs,
            out,
        } = product;
        let work = Pixels {
            offsets,
            plane_len,
            channels,
            source,
            pairs: pixels / 2,
            grad,
            outputs,
            out: out.as_mut_ptr(),
        };
        work.columns::<2>(0..wide);
        work.columns::<1>(wide..outputs);
    }
}

/// A [`PixelPairs`] whose sums are computed in parts.
struct Pixels<'a> {
    offsets: &'a [usize],
    plane_len: usize,
    channels: usize,
    source: &'a [u16],
    pairs: usize,
    grad: &'a [u32],
    outputs: usize,
    out: *mut f32,
}

impl Pixels<'_> {
    /// Computes the sums of some outputs, `V` vectors at once.
    ///
    /// # Safety
    /// As for [`pixels`]; the range must be a multiple of `V` vectors.
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn columns<const V: usize>(&self, outputs: Range<usize>) {
        let taps = self.offsets.len();
        for first in (0..self.pairs).step_by(PIXEL_PAIRS_AT_ONCE) {
            let count = (self.pairs - first).min(PIXEL_PAIRS_AT_ONCE);
            for output in outputs.clone().step_by(V * LANES) {
                for channel in (0..self.channels).step_by(HEIGHT) {
                    for (t, offset) in self.offsets.iter().enumerate() {
                        // SAFETY: guaranteed by the caller.
                        unsafe {
                            let to = self.out.add((channel * taps + t) * self.outputs + output);
                            let mut sums = Sums::<V>::load(to, taps * self.outputs);
                            let from = self
                                .source
                                .as_ptr()
                                .add(channel * self.plane_len + offset + 2 * first);
                            let grad = self.grad.as_ptr().add(first * self.outputs + output);
                            for i in 0..count {
                                let (from, grad) = (from.add(2 * i), grad.add(i * self.outputs));
                                sums.add(from.cast(), 2 * self.plane_len, grad);
                            }
                            sums.store(to, taps * self.outputs);
                        }
                    }
                }
            }
        }
    }
}
