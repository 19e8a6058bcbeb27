//! GELU, y = x·Φ(x), with Φ the cumulative normal distribution (Hendrycks and Gimpel, arXiv 1606.08415), in its exact form.

use crate::activation::exp_negative;
use crate::slot::{Slot, filled, room};
use rayon::prelude::*;

/// Number of values per task.
const CHUNK: usize = 1 << 14;

/// Beyond ± this, Φ is 0 or 1 to within 2e-8.
pub const GELU_END: f32 = 5.5;

/// (Φ(x) − ½)/x as a polynomial in u = 2·(x/[`GELU_END`])² − 1, lowest power first: the Chebyshev interpolation of degree 15 on |x| ≤
/// [`GELU_END`]. Evaluated in f32, x·Φ(x) is within 2e-7·max(1, |x|) of the exact value.
#[allow(clippy::unreadable_literal, reason = "a table of computed values")]
pub const GELU_SERIES: [f32; 16] = [
    0.12855193,
    -0.06417231,
    0.047737796,
    -0.038793795,
    0.032067224,
    -0.02603615,
    0.020384807,
    -0.015062524,
    0.010164212,
    -0.0066506783,
    0.00472357,
    -0.0026587024,
    0.0006399065,
    -0.0003567546,
    0.00065623666,
    -0.0002856763,
];

/// Φ(x).
#[inline]
fn below(x: f32) -> f32 {
    let near = x.clamp(-GELU_END, GELU_END);
    let u = near * near * (2.0 / (GELU_END * GELU_END)) - 1.0;
    let mut series = 0.0;
    for factor in GELU_SERIES.iter().rev() {
        series = series * u + factor;
    }
    near * series + 0.5
}

/// y = x·Φ(x).
///
/// # Panics
/// If the lengths differ.
pub fn gelu(x: &[f32], out: &mut [impl Slot]) {
    assert_eq!(x.len(), out.len(), "output length");
    room(out)
        .par_chunks_mut(CHUNK)
        .zip(x.par_chunks(CHUNK))
        .for_each(|(out, x)| {
            filled(out, x.iter().map(|x| x * below(*x)));
        });
}

/// Gradient of [`gelu`] from its input: ∂x = ∂y·(Φ(x) + x·φ(x)), φ(x) = e^(−x²/2)/√(2π).
///
/// # Panics
/// If the lengths differ.
pub fn gelu_backward(x: &[f32], grad_out: &[f32], grad_x: &mut [impl Slot]) {
    assert_eq!(x.len(), grad_out.len(), "output gradient length");
    assert_eq!(x.len(), grad_x.len(), "input gradient length");
    /// 1/√(2π).
    const PEAK: f32 = 0.398_942_3;
    room(grad_x)
        .par_chunks_mut(CHUNK)
        .zip(x.par_chunks(CHUNK).zip(grad_out.par_chunks(CHUNK)))
        .for_each(|(gx, (x, g))| {
            let gradient = |(x, g): (&f32, &f32)| {
                let density = PEAK * exp_negative(-0.5 * x * x);
                g * (below(*x) + x * density)
            };
            filled(gx, x.iter().zip(g).map(gradient));
        });
}

/// [`gelu`] of an f64, computed slowly, for comparison with faster forms.
///
/// Φ(x) = ½ + φ(x)·(x + x³/3 + x⁵/(3·5) + …), whose terms all have x's sign (Abramowitz and Stegun 26.2.11).
#[must_use]
pub fn gelu_exact(x: f64) -> f64 {
    if x.abs() > 9.0 {
        // Φ is 0 or 1 to within 2e-19.
        return x.max(0.0);
    }
    let (mut term, mut sum, mut odd) = (x, x, 1.0);
    while term.abs() > 1e-18 * sum.abs() {
        odd += 2.0;
        term *= x * x / odd;
        sum += term;
    }
    let density = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    x * (0.5 + density * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values of the normal distribution: Φ(1), Φ(−2), Φ(3).
    #[test]
    fn the_slow_form_has_the_values_of_the_tables() {
        for (x, share) in [
            (1.0, 0.841_344_746_068_543),
            (-2.0, 0.022_750_131_948_179),
            (3.0, 0.998_650_101_968_37),
        ] {
            assert!((gelu_exact(x) - x * share).abs() < 1e-13, "{x}");
        }
        assert_eq!(gelu_exact(0.0), 0.0);
        assert_eq!([gelu_exact(20.0), gelu_exact(-20.0)], [20.0, 0.0]);
        // There is no step where the two forms join.
        assert!((gelu_exact(9.000_001) - gelu_exact(8.999_999) - 2e-6).abs() < 1e-12);
    }

    #[test]
    fn gelu_equals_its_definition() {
        let x: Vec<f32> = (-6000..6000).map(|i| i as f32 * 0.002).collect();
        let mut y = vec![0.0; x.len()];
        gelu(&x, &mut y);
        for (x, y) in x.iter().zip(&y) {
            let off = f64::from(*y) - gelu_exact(f64::from(*x));
            let allowed = 2e-7 * f64::from(x.abs()).max(1.0);
            assert!(off.abs() < allowed, "gelu({x}) = {y}, off by {off:e}");
        }
        let mut y = [0.0; 3];
        gelu(&[f32::NAN, f32::INFINITY, 1e30], &mut y);
        assert!(
            y[0].is_nan() && y[1] == f32::INFINITY && y[2] == 1e30,
            "{y:?}"
        );
    }

    #[test]
    fn gelu_gradient_equals_finite_differences() {
        let x: Vec<f32> = (-600..600).map(|i| i as f32 * 0.013).collect();
        let mut gradient = vec![0.0; x.len()];
        gelu_backward(&x, &vec![2.0; x.len()], &mut gradient);
        for (x, g) in x.iter().zip(&gradient) {
            let (x, h) = (f64::from(*x), 1e-5);
            let numeric = (gelu_exact(x + h) - gelu_exact(x - h)) / h;
            assert!((f64::from(*g) - numeric).abs() < 2e-6, "{x}: {g}");
        }
    }
}
