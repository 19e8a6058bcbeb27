//! The transforms of the weight gradient: of output gradients, and from sums of products to taps.

use super::transform::{load, store};
use crate::conv::product::LANES;
use crate::winograd::{AREA, IN, OUT};
use pulp::{Simd, WithSimd};

/// A m along one axis, with A the transpose of the outputs' Aᵀ.
#[inline(always)]
fn gradient_axis<S: Simd>(simd: S, m: [S::f32s; OUT]) -> [S::f32s; IN] {
    let by = |factor: f32| simd.splat_f32s(factor);
    let madd = |a, b, c| simd.mul_add_f32s(a, b, c);
    let (even, odd) = (simd.add_f32s(m[0], m[2]), simd.add_f32s(m[1], m[3]));
    let far_even = madd(by(4.0), m[2], m[0]);
    let far_odd = simd.mul_f32s(by(2.0), madd(by(4.0), m[3], m[1]));
    [
        m[0],
        simd.add_f32s(even, odd),
        simd.sub_f32s(even, odd),
        simd.add_f32s(far_even, far_odd),
        simd.sub_f32s(far_even, far_odd),
        m[3],
    ]
}

/// Gᵀ g along one axis, with Gᵀ the transpose of the kernels' G.
#[inline(always)]
fn taps_axis<S: Simd>(simd: S, g: [S::f32s; IN]) -> [S::f32s; 3] {
    let by = |factor: f32| simd.splat_f32s(factor);
    let mul = |a, b| simd.mul_f32s(a, b);
    let madd = |a, b, c| simd.mul_add_f32s(a, b, c);
    let (near, near_odd) = (simd.add_f32s(g[1], g[2]), simd.sub_f32s(g[2], g[1]));
    let (far, far_odd) = (simd.add_f32s(g[3], g[4]), simd.sub_f32s(g[3], g[4]));
    let sixth = by(1.0 / 6.0);
    let near = mul(sixth, near);
    [
        simd.sub_f32s(madd(by(1.0 / 24.0), far, mul(by(0.25), g[0])), near),
        madd(by(1.0 / 12.0), far_odd, mul(sixth, near_odd)),
        simd.add_f32s(simd.sub_f32s(mul(sixth, far), near), g[5]),
    ]
}

/// A y Aᵀ of neighbouring tiles' output gradients with interleaved channels: `to[p·to_pitch + t·channels + c]` from
/// `from[row·pitch + (4·t + column)·channels + c]`.
pub(super) struct TransformGradients<'a> {
    pub(super) from: &'a [f32],
    pub(super) pitch: usize,
    pub(super) tiles: usize,
    /// Number of channels, a multiple of [`LANES`].
    pub(super) channels: usize,
    pub(super) to: &'a mut [f32],
    pub(super) to_pitch: usize,
}

impl WithSimd for TransformGradients<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (tiles, channels) = (self.tiles, self.channels);
        assert!(channels.is_multiple_of(LANES), "whole vectors of channels");
        let last = (OUT - 1) * self.pitch + OUT * tiles * channels;
        assert!(self.from.len() >= last, "gradients of tiles");
        let last = (AREA - 1) * self.to_pitch + tiles * channels;
        assert!(self.to.len() >= last, "transformed gradients");
        let (from, to) = (self.from.as_ptr(), self.to.as_mut_ptr());
        let zero = simd.splat_f32s(0.0);
        for t in 0..tiles {
            for c in (0..channels).step_by(S::F32_LANES) {
                let mut half = [[zero; OUT]; IN];
                // SAFETY: asserted above; LANES is a multiple of a vector's lanes.
                unsafe {
                    for j in 0..OUT {
                        let at = (OUT * t + j) * channels + c;
                        let m = std::array::from_fn(|i| load::<S>(from, i * self.pitch + at));
                        let m = gradient_axis(simd, m);
                        for i in 0..IN {
                            half[i][j] = m[i];
                        }
                    }
                    for i in 0..IN {
                        let m = gradient_axis(simd, half[i]);
                        for j in 0..IN {
                            let at = (i * IN + j) * self.to_pitch + t * channels + c;
                            store::<S>(to, at, m[j]);
                        }
                    }
                }
            }
        }
    }
}

/// Gᵀ z G of one input channel's sums: `to[tap·outputs + o]` from `from[p·pitch + o]`.
pub(super) struct TransformTaps<'a> {
    pub(super) from: &'a [f32],
    pub(super) pitch: usize,
    /// Number of outputs, a multiple of [`LANES`].
    pub(super) outputs: usize,
    pub(super) to: &'a mut [f32],
}

impl WithSimd for TransformTaps<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let outputs = self.outputs;
        assert!(outputs.is_multiple_of(LANES), "whole vectors of outputs");
        let last = (AREA - 1) * self.pitch + outputs;
        assert!(self.from.len() >= last, "sums of products");
        assert!(self.to.len() >= 9 * outputs, "taps");
        let (from, to) = (self.from.as_ptr(), self.to.as_mut_ptr());
        let zero = simd.splat_f32s(0.0);
        for o in (0..outputs).step_by(S::F32_LANES) {
            let mut half = [[zero; IN]; 3];
            // SAFETY: asserted above; LANES is a multiple of a vector's lanes.
            unsafe {
                for j in 0..IN {
                    let z = std::array::from_fn(|i| load::<S>(from, (i * IN + j) * self.pitch + o));
                    let z = taps_axis(simd, z);
                    for y in 0..3 {
                        half[y][j] = z[y];
                    }
                }
                for y in 0..3 {
                    let taps = taps_axis(simd, half[y]);
                    for x in 0..3 {
                        store::<S>(to, (y * 3 + x) * outputs + o, taps[x]);
                    }
                }
            }
        }
    }
}
