//! Activations on vectors, and on rows that were just written and are still in the L1 cache.

use pulp::Simd;

use crate::Activation;
use deepfusion_kernels::{GELU_END, GELU_SERIES};

/// eᵛ for v ≤ 0, to 2 units in the last place: 2ⁿ·p(r), v = n·ln2 + r.
#[inline(always)]
pub(crate) fn exp_negative<S: Simd>(simd: S, v: S::f32s) -> S::f32s {
    let by = |factor: f32| simd.splat_f32s(factor);
    let madd = |a, b, c| simd.mul_add_f32s(a, b, c);
    // Adding 1.5·2²³ rounds to the nearest integer, which is then in the lowest bits.
    let round = by(12_582_912.0);
    let v = simd.max_f32s(by(-87.0), v);
    let rounded = madd(v, by(std::f32::consts::LOG2_E), round);
    let n = simd.sub_f32s(rounded, round);
    let r = madd(n, by(2.121_944_4e-4), madd(n, by(-0.693_359_4), v));
    let mut p = by(0.001_394_4);
    for c in [0.008_333_5, 0.041_665_8, 0.166_666_66, 0.5, 1.0, 1.0] {
        p = madd(p, r, by(c));
    }
    let biased = simd.add_u32s(simd.transmute_u32s_f32s(rounded), simd.splat_u32s(127));
    let power = simd.wrapping_dyn_shl_u32s(biased, simd.splat_u32s(23));
    simd.mul_f32s(p, simd.transmute_f32s_u32s(power))
}

impl Activation {
    #[inline(always)]
    pub(crate) fn of<S: Simd>(self, simd: S, v: S::f32s) -> S::f32s {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        match self {
            Self::Identity => v,
            // Constants first, so that x86 keeps NaN.
            Self::Relu => simd.max_f32s(zero, v),
            Self::Elu => {
                let negative = exp_negative(simd, simd.min_f32s(zero, v));
                simd.add_f32s(simd.max_f32s(zero, v), simd.sub_f32s(negative, one))
            }
            Self::Gelu => {
                // Constants first, so that x86 keeps NaN.
                let end = simd.splat_f32s(GELU_END);
                let near = simd.min_f32s(end, simd.max_f32s(simd.neg_f32s(end), v));
                let scale = simd.splat_f32s(2.0 / (GELU_END * GELU_END));
                let u = simd.mul_add_f32s(simd.mul_f32s(near, near), scale, simd.neg_f32s(one));
                let mut series = zero;
                for factor in GELU_SERIES.iter().rev() {
                    series = simd.mul_add_f32s(series, u, simd.splat_f32s(*factor));
                }
                let below = simd.mul_add_f32s(near, series, simd.splat_f32s(0.5));
                simd.mul_f32s(v, below)
            }
            Self::LeakyRelu => {
                let below = simd.min_f32s(zero, v);
                simd.mul_add_f32s(below, simd.splat_f32s(0.01), simd.max_f32s(zero, v))
            }
            Self::Tanh => {
                // Near 0, the subtraction in (1 − e^−2|x|) / (1 + e^−2|x|) cancels digits and loses 1e-7, as in a sum of f32s near 1.
                let e = exp_negative(simd, simd.mul_f32s(simd.splat_f32s(-2.0), simd.abs_f32s(v)));
                let t = simd.div_f32s(simd.sub_f32s(one, e), simd.add_f32s(one, e));
                simd.select_f32s(simd.less_than_f32s(v, zero), simd.neg_f32s(t), t)
            }
            Self::Sigmoid => {
                // e^−|x| never overflows.
                let e = exp_negative(simd, simd.neg_f32s(simd.abs_f32s(v)));
                let s = simd.div_f32s(one, simd.add_f32s(one, e));
                let below = simd.less_than_f32s(v, zero);
                simd.select_f32s(below, simd.mul_f32s(e, s), s)
            }
        }
    }

    /// Applies the activation in place.
    ///
    /// # Safety
    /// `row` must have `len` values.
    #[inline(always)]
    pub(crate) unsafe fn apply<S: Simd>(self, simd: S, row: *mut f32, len: usize) {
        let whole = len / S::F32_LANES * S::F32_LANES;
        for i in (0..whole).step_by(S::F32_LANES) {
            // SAFETY: guaranteed by the caller.
            unsafe {
                let at = row.add(i).cast::<S::f32s>();
                at.write_unaligned(self.of(simd, at.read_unaligned()));
            }
        }
        for i in whole..len {
            // SAFETY: as above.
            unsafe {
                let value = self.of(simd, simd.splat_f32s(*row.add(i)));
                *row.add(i) = *(&raw const value).cast::<f32>();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct Apply<'a>(Activation, &'a mut [f32]);

    impl WithSimd for Apply<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            // SAFETY: the whole slice.
            unsafe { self.0.apply(simd, self.1.as_mut_ptr(), self.1.len()) };
        }
    }

    #[test]
    fn activations_equal_their_definitions() {
        let x: Vec<f32> = (-1601..1600).map(|i| i as f32 * 0.0625).collect();
        let check = |activation, exact: fn(f64) -> f64, tolerance: f64| {
            let mut y = x.clone();
            Arch::new().dispatch(Apply(activation, &mut y));
            for (x, y) in x.iter().zip(&y) {
                let exact = exact(f64::from(*x));
                assert!(
                    (f64::from(*y) - exact).abs() <= tolerance,
                    "{activation:?}({x}) = {y}"
                );
            }
        };
        check(Activation::Identity, |x| x, 0.0);
        check(Activation::Relu, |x| x.max(0.0), 0.0);
        // eˣ − 1 loses the digits that the subtraction cancels.
        check(
            Activation::Elu,
            |x| if x > 0.0 { x } else { x.exp_m1() },
            3e-7,
        );
        check(Activation::Sigmoid, |x| 1.0 / (1.0 + (-x).exp()), 2e-7);
        check(Activation::Tanh, f64::tanh, 3e-7);
        // A hundredth of a value up to 100, rounded to f32.
        check(
            Activation::LeakyRelu,
            |x| if x > 0.0 { x } else { 0.01 * x },
            1e-7,
        );
        // Values up to 100, rounded to f32.
        check(Activation::Gelu, deepfusion_kernels::gelu_exact, 6e-6);
    }

    #[test]
    fn nan_stays_nan() {
        for activation in [
            Activation::Identity,
            Activation::Relu,
            Activation::Elu,
            Activation::Sigmoid,
            Activation::Gelu,
            Activation::LeakyRelu,
            Activation::Tanh,
        ] {
            let mut y = [f32::NAN; 16];
            Arch::new().dispatch(Apply(activation, &mut y));
            assert!(y.iter().all(|y| y.is_nan()), "{activation:?}: {y:?}");
        }
    }
}
