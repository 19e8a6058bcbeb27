//! The weight gradient of a convolution with few outputs, such as a head's.
//!
//! The vectors of [`super::product::PixelProduct`] run along the outputs; a single output would use one of sixteen lanes. Here they run
//! along neighbouring pixels: each weight's gradient is a dot product of two images, one of them shifted by its tap.

use super::{
    ConvShape,
    lattice::{Lattice, Tile, gather_channels},
    product::{LANES, padded},
};
use crate::scratch::with_scratch;
use pulp::{Arch, Simd, WithSimd};

/// Number of outputs below which this is faster.
pub(super) const FEW: usize = 8;

/// Adds the weight gradient over a tile to `sum`, outputs × taps.
pub(super) fn add(shape: &ConvShape, tile: Tile, x: &[f32], grad_out: &[f32], sum: &mut [f32]) {
    let lattice = Lattice::new(shape.window(), tile);
    let columns = padded(lattice.columns());
    let offsets = shape.tap_offsets(&lattice, 0..shape.in_channels);
    let source_len = shape.in_channels * lattice.plane_len;
    with_scratch(source_len + columns, |buffer| {
        let (source, grad) = buffer.split_at_mut(source_len);
        gather_channels(&lattice, x, shape.in_channels, 0..shape.in_channels, source);
        // Zero in columns that are not pixels.
        grad.fill(0.0);
        for (output, sum) in sum.chunks_exact_mut(offsets.len()).enumerate() {
            copy_pixels(shape, &lattice, tile, output, grad_out, grad);
            let product = DotProducts {
                offsets: &offsets,
                source,
                grad,
                out: sum,
            };
            product.run();
        }
    });
}

/// Copies a tile's pixels of one output into their columns.
fn copy_pixels(
    shape: &ConvShape,
    lattice: &Lattice,
    tile: Tile,
    output: usize,
    grad_out: &[f32],
    to: &mut [f32],
) {
    let (area, width) = (shape.out_area(), shape.out_width());
    for image in 0..tile.images {
        let plane = ((tile.first_image + image) * shape.out_channels + output) * area;
        for row in 0..tile.rows {
            let from = &grad_out[plane + (tile.first_row + row) * width..][..width];
            to[lattice.column(image, row)..][..width].copy_from_slice(from);
        }
    }
}

/// `out[t] += Σ_q grad[q] · source[offsets[t] + q]`
struct DotProducts<'a> {
    offsets: &'a [usize],
    source: &'a [f32],
    /// Its length is a multiple of whole vectors.
    grad: &'a [f32],
    out: &'a mut [f32],
}

impl DotProducts<'_> {
    fn run(self) {
        assert_eq!(self.grad.len() % LANES, 0, "whole vectors");
        assert_eq!(self.out.len(), self.offsets.len(), "output length");
        let last = self.offsets.iter().max().map_or(0, |o| o + self.grad.len());
        assert!(self.source.len() >= last, "source length");
        Arch::new().dispatch(self);
    }
}

impl WithSimd for DotProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (offsets, rest) = self.offsets.as_chunks::<8>();
        let (out, rest_out) = self.out.as_chunks_mut::<8>();
        // SAFETY: bounds are asserted in `run`.
        unsafe {
            for (offsets, out) in offsets.iter().zip(out) {
                dot(simd, offsets, self.source, self.grad, out);
            }
            for (offset, out) in rest.iter().zip(rest_out) {
                let (offset, out) = (&[*offset], std::array::from_mut(out));
                dot(simd, offset, self.source, self.grad, out);
            }
        }
    }
}

/// `TAPS` dot products at once: the gradient is read once for all of them.
///
/// # Safety
/// `source` must be as long as `grad` beyond every offset, and `grad` must be whole vectors.
#[inline(always)]
unsafe fn dot<S: Simd, const TAPS: usize>(
    simd: S,
    offsets: &[usize; TAPS],
    source: &[f32],
    grad: &[f32],
    out: &mut [f32; TAPS],
) {
    let mut sums = [simd.splat_f32s(0.0); TAPS];
    for q in (0..grad.len()).step_by(S::F32_LANES) {
        // SAFETY: guaranteed by the caller.
        unsafe {
            let factor = grad.as_ptr().add(q).cast::<S::f32s>().read_unaligned();
            for (sum, offset) in sums.iter_mut().zip(offsets) {
                let from = source.as_ptr().add(offset + q).cast::<S::f32s>();
                *sum = simd.mul_add_f32s(factor, from.read_unaligned(), *sum);
            }
        }
    }
    for (out, sum) in out.iter_mut().zip(sums) {
        *out += simd.reduce_sum_f32s(sum);
    }
}
