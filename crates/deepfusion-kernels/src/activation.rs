use crate::{
    lanes::sum,
    slot::{Slot, filled, room},
};
use rayon::prelude::*;

/// Number of values per task.
const CHUNK: usize = 1 << 14;

/// The sum of every channel over images and pixels, which is the gradient of a bias.
///
/// # Shapes
/// `x` N×C×`area`, `out` C, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn channel_sums(x: &[f32], batch: usize, area: usize, out: &mut [f32]) {
    let channels = out.len();
    assert_eq!(x.len(), batch * channels * area, "input length");
    out.par_iter_mut().enumerate().for_each(|(c, total)| {
        *total = (0..batch)
            .map(|n| sum(&x[(n * channels + c) * area..][..area]))
            .sum();
    });
}

/// exp(v) for v ≤ 0, to 2 units in the last place: 2ⁿ·p(r), v = n·ln2 + r. Written so that the compiler vectorises loops over it, which a
/// call of libm's `exp` would prevent.
#[inline]
pub(crate) fn exp_negative(v: f32) -> f32 {
    let v = v.max(-87.0);
    // Adding and subtracting 1.5·2²³ rounds to the nearest integer, without a call.
    const ROUND: f32 = 12_582_912.0;
    let n = v * std::f32::consts::LOG2_E + ROUND - ROUND;
    let r = v - n * 0.693_359_4 + n * 2.121_944_4e-4;
    let p = 1.0
        + r * (1.0
            + r * (0.5
                + r * (0.166_666_66 + r * (0.041_665_8 + r * (0.008_333_5 + r * 0.001_394_4)))));
    // -126 <= n <= 0
    let power = f32::from_bits((((n as i32) + 127) << 23) as u32);
    p * power
}

/// ELU, α = 1: y = x where x > 0, eˣ − 1 elsewhere.
///
/// # Panics
/// If the lengths differ.
pub fn elu(x: &[f32], out: &mut [impl Slot]) {
    assert_eq!(x.len(), out.len(), "output length");
    room(out)
        .par_chunks_mut(CHUNK)
        .zip(x.par_chunks(CHUNK))
        .for_each(|(out, x)| {
            let elu = |x: &f32| {
                let negative = exp_negative(x.min(0.0)) - 1.0;
                // NaN stays NaN: a minimum would turn it into 0, and the loss of a run that diverged would look normal.
                if *x > 0.0 || x.is_nan() { *x } else { negative }
            };
            filled(out, x.iter().map(elu));
        });
}

/// Gradient of [`elu`] from its output: ∂x = ∂y where y > 0, ∂y·(y + 1) elsewhere.
///
/// # Panics
/// If the lengths differ.
pub fn elu_backward(y: &[f32], grad_out: &[f32], grad_x: &mut [impl Slot]) {
    assert_eq!(y.len(), grad_out.len(), "output gradient length");
    assert_eq!(y.len(), grad_x.len(), "input gradient length");
    room(grad_x)
        .par_chunks_mut(CHUNK)
        .zip(y.par_chunks(CHUNK).zip(grad_out.par_chunks(CHUNK)))
        .for_each(|(gx, (y, g))| {
            let gradient = |(y, g): (&f32, &f32)| {
                let slope = y.min(0.0) + 1.0;
                g * if y.is_nan() { *y } else { slope }
            };
            filled(gx, y.iter().zip(g).map(gradient));
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_stays_nan() {
        let (x, mut y, mut gradient) = ([1.0, f32::NAN, -1.0], [0.0; 3], [0.0; 3]);
        elu(&x, &mut y);
        elu_backward(&y, &[1.0; 3], &mut gradient);
        for values in [y, gradient] {
            assert_eq!(values.map(f32::is_nan), [false, true, false], "{values:?}");
        }
    }

    #[test]
    fn elu_equals_its_definition() {
        let x: Vec<f32> = (-4000..400).map(|i| i as f32 * 0.03).collect();
        let mut y = vec![0.0; x.len()];
        elu(&x, &mut y);
        for (x, y) in x.iter().zip(&y) {
            let exact = if *x > 0.0 {
                f64::from(*x)
            } else {
                f64::from(*x).exp_m1()
            };
            // Absolute tolerance: near zero, the subtraction in e^x - 1 cancels digits.
            assert!((f64::from(*y) - exact).abs() < 3e-7, "elu({x}) = {y}");
        }
    }

    #[test]
    fn elu_gradient_equals_finite_differences() {
        let x: Vec<f32> = vec![-3.0, -1.0, -0.2, 0.3, 2.0];
        let mut y = vec![0.0; x.len()];
        elu(&x, &mut y);
        let mut gradient = vec![0.0; x.len()];
        elu_backward(&y, &[1.0; 5], &mut gradient);
        for (x, g) in x.iter().zip(&gradient) {
            let f = |x: f64| if x > 0.0 { x } else { x.exp_m1() };
            let h = 1e-6;
            let numeric = (f(f64::from(*x) + h) - f(f64::from(*x) - h)) / (2.0 * h);
            assert!((f64::from(*g) - numeric).abs() < 1e-5);
        }
    }
}
