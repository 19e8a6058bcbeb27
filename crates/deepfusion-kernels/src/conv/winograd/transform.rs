//! The transforms of inputs, kernels and outputs, on vectors of values that belong to neighbouring tiles or channels.

use crate::conv::product::LANES;
use crate::winograd::{AREA, IN, OUT, input_axis, output_axis};
use pulp::{Simd, WithSimd};

/// Reads a vector.
///
/// # Safety
/// It must be within the memory that `from` points into.
#[inline(always)]
pub(super) unsafe fn load<S: Simd>(from: *const f32, at: usize) -> S::f32s {
    // SAFETY: guaranteed by the caller.
    unsafe { from.add(at).cast::<S::f32s>().read_unaligned() }
}

/// Writes a vector.
///
/// # Safety
/// As for [`load`]; nobody else may use that memory.
#[inline(always)]
pub(super) unsafe fn store<S: Simd>(to: *mut f32, at: usize, value: S::f32s) {
    // SAFETY: guaranteed by the caller.
    unsafe { to.add(at).cast::<S::f32s>().write_unaligned(value) }
}

/// G g along one axis.
#[inline(always)]
fn kernel_axis<S: Simd>(simd: S, g: [S::f32s; 3]) -> [S::f32s; IN] {
    let by = |factor: f32| simd.splat_f32s(factor);
    let mul = |a, b| simd.mul_f32s(a, b);
    let ends = mul(by(-1.0 / 6.0), simd.add_f32s(g[0], g[2]));
    let far = simd.mul_add_f32s(by(1.0 / 24.0), g[0], mul(by(1.0 / 6.0), g[2]));
    let madd = |factor: f32, b| simd.mul_add_f32s(by(factor), g[1], b);
    [
        mul(by(0.25), g[0]),
        madd(-1.0 / 6.0, ends),
        madd(1.0 / 6.0, ends),
        madd(1.0 / 12.0, far),
        madd(-1.0 / 12.0, far),
        g[2],
    ]
}

/// Bᵀ d B of the tiles of one channel: `to[p·to_pitch + t]` from `from[p·pitch + t]`, p = 6·row + column.
pub(super) struct TransformInputs<'a> {
    pub(super) from: &'a [f32],
    pub(super) pitch: usize,
    /// Number of tiles, a multiple of [`LANES`].
    pub(super) tiles: usize,
    pub(super) to: &'a mut [f32],
    pub(super) to_pitch: usize,
}

impl WithSimd for TransformInputs<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let reach = |pitch: usize| (AREA - 1) * pitch + self.tiles;
        assert!(self.tiles.is_multiple_of(LANES), "whole vectors of tiles");
        assert!(self.from.len() >= reach(self.pitch), "inputs of tiles");
        assert!(self.to.len() >= reach(self.to_pitch), "transformed inputs");
        let (from, to) = (self.from.as_ptr(), self.to.as_mut_ptr());
        let zero = simd.splat_f32s(0.0);
        for t in (0..self.tiles).step_by(S::F32_LANES) {
            let mut half = [[zero; IN]; IN];
            // SAFETY: asserted above; LANES is a multiple of a vector's lanes.
            unsafe {
                for j in 0..IN {
                    let d = std::array::from_fn(|i| load::<S>(from, (i * IN + j) * self.pitch + t));
                    let d = input_axis(simd, d);
                    for i in 0..IN {
                        half[i][j] = d[i];
                    }
                }
                for i in 0..IN {
                    let d = input_axis(simd, half[i]);
                    for j in 0..IN {
                        store::<S>(to, (i * IN + j) * self.to_pitch + t, d[j]);
                    }
                }
            }
        }
    }
}

/// Aᵀ m A plus `bias` for the tiles of one output channel: `to[(4·row + column)·to_pitch + t]` from `from[p·pitch + t]`.
pub(super) struct TransformOutputs<'a> {
    pub(super) from: &'a [f32],
    pub(super) pitch: usize,
    /// Number of tiles, a multiple of [`LANES`].
    pub(super) tiles: usize,
    pub(super) bias: f32,
    pub(super) to: &'a mut [f32],
    pub(super) to_pitch: usize,
}

impl WithSimd for TransformOutputs<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        assert!(self.tiles.is_multiple_of(LANES), "whole vectors of tiles");
        let last = (AREA - 1) * self.pitch + self.tiles;
        assert!(self.from.len() >= last, "products of tiles");
        let last = (OUT * OUT - 1) * self.to_pitch + self.tiles;
        assert!(self.to.len() >= last, "outputs of tiles");
        let (from, to) = (self.from.as_ptr(), self.to.as_mut_ptr());
        let (zero, bias) = (simd.splat_f32s(0.0), simd.splat_f32s(self.bias));
        for t in (0..self.tiles).step_by(S::F32_LANES) {
            let mut half = [[zero; IN]; OUT];
            // SAFETY: asserted above; LANES is a multiple of a vector's lanes.
            unsafe {
                for j in 0..IN {
                    let m = std::array::from_fn(|i| load::<S>(from, (i * IN + j) * self.pitch + t));
                    let m = output_axis(simd, m);
                    for i in 0..OUT {
                        half[i][j] = m[i];
                    }
                }
                for i in 0..OUT {
                    let values = output_axis(simd, half[i]);
                    for j in 0..OUT {
                        let value = simd.add_f32s(values[j], bias);
                        store::<S>(to, (i * OUT + j) * self.to_pitch + t, value);
                    }
                }
            }
        }
    }
}

/// G g Gᵀ of [`LANES`] kernels: `to[p][lane]` from `taps[tap][lane]`.
pub(super) struct TransformKernels<'a> {
    pub(super) taps: &'a [[f32; LANES]; 9],
    pub(super) to: &'a mut [[f32; LANES]; AREA],
}

impl WithSimd for TransformKernels<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (from, to) = (
            self.taps.as_ptr().cast::<f32>(),
            self.to.as_mut_ptr().cast::<f32>(),
        );
        let zero = simd.splat_f32s(0.0);
        for lane in (0..LANES).step_by(S::F32_LANES) {
            let mut half = [[zero; 3]; IN];
            // SAFETY: whole rows of LANES, a multiple of a vector's lanes.
            unsafe {
                for x in 0..3 {
                    let g = std::array::from_fn(|y| load::<S>(from, (y * 3 + x) * LANES + lane));
                    let g = kernel_axis(simd, g);
                    for i in 0..IN {
                        half[i][x] = g[i];
                    }
                }
                for i in 0..IN {
                    let g = kernel_axis(simd, half[i]);
                    for j in 0..IN {
                        store::<S>(to, (i * IN + j) * LANES + lane, g[j]);
                    }
                }
            }
        }
    }
}
