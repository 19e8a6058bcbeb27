//! The inner loops: small blocks of sums kept in registers, one vector of neighbouring pixels each.

use super::CorrelationShape;
use crate::send_ptr::SharedMut;
use pulp::{Simd, WithSimd};

/// The lanes of the widest vectors: padded rows are read in whole vectors.
pub(super) const LANES: usize = 16;

/// All products of one row of the second image with the row of the first that each pair names.
///
/// A vector of the second image is used for several rows of the first before the next is loaded, and vice versa. Three of each give nine
/// sums from six loads, enough to hide the latency of the multiply-adds.
pub(super) struct RowCorrelation<'a> {
    pub(super) shape: &'a CorrelationShape,
    /// Offset of a row of the first image in its padded copy, and of its outputs for the leftmost displacement.
    pub(super) pairs: &'a [(usize, usize)],
    /// The padded first images.
    pub(super) first: &'a [f32],
    /// The padded second image, from the row on.
    pub(super) second: &'a [f32],
    /// No other task writes the pairs' output rows.
    pub(super) out: SharedMut<'a, f32>,
}

/// One row of a gradient, all channels: `out[c][x] = (1/C) Σ_taps grad[tap.0 + x] · other[c][tap.1 + x]`.
pub(super) struct DisplacementSums<'a> {
    pub(super) shape: &'a CorrelationShape,
    /// Offsets of a displacement's products, for the row's first pixel.
    pub(super) taps: &'a [(usize, usize)],
    /// The padded output gradient of the image.
    pub(super) grad: &'a [f32],
    /// The padded planes of the image that the gradient is multiplied with.
    pub(super) other: &'a [f32],
    /// No other task writes this row.
    pub(super) out: SharedMut<'a, f32>,
    /// Offset of the row in the first channel's plane.
    pub(super) start: usize,
}

/// Stores as many of the vector's values as there is room for.
#[inline(always)]
fn store<S: Simd>(simd: S, values: S::f32s, to: &mut [f32]) {
    if to.len() == S::F32_LANES {
        // SAFETY: that many floats.
        unsafe { to.as_mut_ptr().cast::<S::f32s>().write_unaligned(values) }
    } else {
        simd.partial_store_f32s(to, values);
    }
}

/// Calls `$call` with a constant for the block's size.
macro_rules! with_size {
    ($size:expr, |$N:ident| $call:expr; $($n:literal)*) => {
        match $size {
            $($n => { const $N: usize = $n; $call })*
            _ => unreachable!("a block's size is one of the listed"),
        }
    };
}

impl WithSimd for RowCorrelation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let side = self.shape.side();
        // The furthest read of the blocks: the last channel of the last vector.
        let span = (self.shape.channels - 1) * self.shape.plane();
        let row = self.shape.width.next_multiple_of(LANES);
        assert!(self.second.len() >= span + row + side - 1, "second image");
        let last = self.pairs.iter().map(|pair| pair.0).max().unwrap_or(0);
        assert!(self.first.len() >= last + span + row, "first image");
        let mut done = 0;
        while done < self.pairs.len() {
            let rows = (self.pairs.len() - done).min(3);
            let mut right = 0;
            while right < side {
                let columns = (side - right).min(3);
                for x in (0..self.shape.width).step_by(S::F32_LANES) {
                    with_size!(rows, |ROWS| with_size!(columns, |COLUMNS| {
                        // SAFETY: bounds are asserted above.
                        unsafe { self.block::<S, ROWS, COLUMNS>(simd, done, right, x) }
                    }; 3 2 1); 3 2 1);
                }
                right += columns;
            }
            done += rows;
        }
    }
}

impl RowCorrelation<'_> {
    /// Computes `ROWS` pairs from `done` on with `COLUMNS` displacements from `right` on, for the vector of pixels at `x`.
    ///
    /// # Safety
    /// The padded images must be as long as `with_simd` asserts.
    #[inline(always)]
    unsafe fn block<S: Simd, const ROWS: usize, const COLUMNS: usize>(
        &self,
        simd: S,
        done: usize,
        right: usize,
        x: usize,
    ) {
        let shape = self.shape;
        let mut sums = [[simd.splat_f32s(0.0); COLUMNS]; ROWS];
        let mut rows = [self.first.as_ptr(); ROWS];
        for (row, pair) in rows.iter_mut().zip(&self.pairs[done..]) {
            *row = row.wrapping_add(pair.0 + x);
        }
        let second = self.second.as_ptr().wrapping_add(right + x);
        for c in 0..shape.channels {
            let at = c * shape.plane();
            let mut vectors = [simd.splat_f32s(0.0); COLUMNS];
            // SAFETY: guaranteed by the caller.
            unsafe {
                for (j, vector) in vectors.iter_mut().enumerate() {
                    *vector = second.add(at + j).cast::<S::f32s>().read_unaligned();
                }
                for (row, sums) in rows.iter().zip(&mut sums) {
                    let row = row.add(at).cast::<S::f32s>().read_unaligned();
                    for (vector, sum) in vectors.iter().zip(sums) {
                        *sum = simd.mul_add_f32s(row, *vector, *sum);
                    }
                }
            }
        }
        let share = simd.splat_f32s(shape.share());
        let count = S::F32_LANES.min(shape.width - x);
        for (sums, pair) in sums.iter().zip(&self.pairs[done..]) {
            for (j, sum) in sums.iter().enumerate() {
                let at = pair.1 + (right + j) * shape.area() + x;
                // SAFETY: every output row belongs to one task.
                let to = unsafe { self.out.slice(at, count) };
                store(simd, simd.mul_f32s(*sum, share), to);
            }
        }
    }
}

impl WithSimd for DisplacementSums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let channels = self.shape.channels;
        let row = self.shape.width.next_multiple_of(LANES);
        let last = |of: fn(&(usize, usize)) -> usize| self.taps.iter().map(of).max().unwrap_or(0);
        assert!(self.grad.len() >= last(|tap| tap.0) + row, "gradient");
        let other = last(|tap| tap.1) + (channels - 1) * self.shape.plane() + row;
        assert!(self.other.len() >= other, "other image");
        let most = if S::REGISTER_COUNT >= 32 { 16 } else { 8 };
        let mut c = 0;
        while c < channels {
            let rows = match channels - c {
                left if left >= most => most,
                8.. => 8,
                4.. => 4,
                2.. => 2,
                _ => 1,
            };
            for x in (0..self.shape.width).step_by(S::F32_LANES) {
                with_size!(rows, |ROWS| {
                    // SAFETY: bounds are asserted above.
                    unsafe { self.block::<S, ROWS>(simd, c, x) }
                }; 16 8 4 2 1);
            }
            c += rows;
        }
    }
}

impl DisplacementSums<'_> {
    /// Computes `ROWS` channels from `c` on, for the vector of pixels at `x`.
    ///
    /// # Safety
    /// The padded images must be as long as `with_simd` asserts.
    #[inline(always)]
    unsafe fn block<S: Simd, const ROWS: usize>(&self, simd: S, c: usize, x: usize) {
        let shape = self.shape;
        let mut sums = [simd.splat_f32s(0.0); ROWS];
        let grad = self.grad.as_ptr().wrapping_add(x);
        let other = self.other.as_ptr().wrapping_add(c * shape.plane() + x);
        for &(in_grad, in_other) in self.taps {
            // SAFETY: guaranteed by the caller.
            unsafe {
                let factor = grad.add(in_grad).cast::<S::f32s>().read_unaligned();
                for (m, sum) in sums.iter_mut().enumerate() {
                    let from = other.add(in_other + m * shape.plane());
                    let vector = from.cast::<S::f32s>().read_unaligned();
                    *sum = simd.mul_add_f32s(factor, vector, *sum);
                }
            }
        }
        let share = simd.splat_f32s(shape.share());
        let count = S::F32_LANES.min(shape.width - x);
        for (m, sum) in sums.iter().enumerate() {
            let at = self.start + (c + m) * shape.area() + x;
            // SAFETY: every output row belongs to one task.
            let to = unsafe { self.out.slice(at, count) };
            store(simd, simd.mul_f32s(*sum, share), to);
        }
    }
}
