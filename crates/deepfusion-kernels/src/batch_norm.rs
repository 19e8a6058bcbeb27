//! Batch normalisation of N×C×H×W, with an optional ReLU after it.
//!
//! x̂ = (x − μ_c)/√(σ²_c + ε), y = γ_c·x̂ + β_c; μ and σ² over images and pixels (σ² without Bessel's
//! correction).

use crate::{
    lanes::{sum, sum_product},
    send_ptr::SharedMut,
    slot::{Slot, filled, room},
};
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// The batch statistics, for the backward pass and for the running statistics.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchNormSaved {
    /// Mean of each channel, C.
    pub mean: Vec<f32>,
    /// Variance of each channel, without Bessel's correction, C.
    pub variance: Vec<f32>,
}

fn planes(len: usize, channels: usize, area: usize) -> usize {
    assert!(channels > 0 && area > 0, "an image has channels and pixels");
    assert_eq!(len % (channels * area), 0, "whole images");
    len / (channels * area)
}

/// The sum of (v − shift)², with one partial sum per lane.
fn sum_squares(values: &[f32], shift: f32) -> f32 {
    let mut lanes = [0.0f32; 16];
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            let d = *v - shift;
            *lane += d * d;
        }
    }
    lanes.iter().sum::<f32>() + rest.iter().map(|v| (v - shift) * (v - shift)).sum::<f32>()
}

/// Normalises with the statistics of the batch.
///
/// # Shapes
/// `x` and `out` N×C×`area`, `gamma` and `beta` C.
///
/// # Panics
/// If a length does not match.
pub fn batch_norm(
    x: &[f32],
    gamma: &[f32],
    beta: &[f32],
    area: usize,
    epsilon: f32,
    relu: bool,
    out: &mut [impl Slot],
) -> BatchNormSaved {
    let channels = gamma.len();
    let batch = planes(x.len(), channels, area);
    assert_eq!(beta.len(), channels, "beta length");
    assert_eq!(out.len(), x.len(), "output length");
    let plane = |n: usize, c: usize| (n * channels + c) * area;
    let count = (batch * area) as f32;
    let to = SharedMut::new(room(out));
    let (mean, variance) = (0..channels)
        .into_par_iter()
        .map(|c| {
            let mean = (0..batch)
                .map(|n| sum(&x[plane(n, c)..][..area]))
                .sum::<f32>()
                / count;
            let variance = (0..batch)
                .map(|n| sum_squares(&x[plane(n, c)..][..area], mean))
                .sum::<f32>()
                / count;
            let scale = gamma[c] / (variance + epsilon).sqrt();
            for n in 0..batch {
                // SAFETY: each channel's planes are written by its own task.
                let out = unsafe { to.slice(plane(n, c), area) };
                apply(&x[plane(n, c)..][..area], mean, scale, beta[c], relu, out);
            }
            (mean, variance)
        })
        .unzip();
    BatchNormSaved { mean, variance }
}

fn apply(x: &[f32], mean: f32, scale: f32, beta: f32, relu: bool, out: &mut [MaybeUninit<f32>]) {
    let floor = if relu { 0.0 } else { f32::NEG_INFINITY };
    // `f32::max` would replace NaN by a number, and hide a loss of NaN.
    let normalised = |x: &f32| {
        let y = (x - mean) * scale + beta;
        if y < floor { floor } else { y }
    };
    filled(out, x.iter().map(normalised));
}

/// Gradients of [`batch_norm`]: with M values per channel and g = ∂y (zero where the ReLU is inactive), ∂β = Σg, ∂γ = Σg·x̂, ∂x = γ/σ·(g −
/// ∂β/M − x̂·∂γ/M). Returns (∂γ, ∂β).
///
/// # Shapes
/// `x`, `grad_out` and `grad_x` N×C×`area`; `grad_x` is overwritten.
///
/// # Panics
/// If a length does not match.
pub fn batch_norm_backward(
    x: &[f32],
    gamma: &[f32],
    beta: &[f32],
    saved: &BatchNormSaved,
    grad_out: &[f32],
    area: usize,
    epsilon: f32,
    relu: bool,
    grad_x: &mut [impl Slot],
) -> (Vec<f32>, Vec<f32>) {
    let channels = gamma.len();
    let batch = planes(x.len(), channels, area);
    assert_eq!(grad_out.len(), x.len(), "output gradient length");
    assert_eq!(grad_x.len(), x.len(), "input gradient length");
    let plane = |n: usize, c: usize| (n * channels + c) * area;
    let count = (batch * area) as f32;
    let to = SharedMut::new(room(grad_x));
    (0..channels)
        .into_par_iter()
        .map(|c| {
            let inverse_std = 1.0 / (saved.variance[c] + epsilon).sqrt();
            let (mean, scale) = (saved.mean[c], gamma[c] * inverse_std);
            let (mut grad_beta, mut grad_gx) = (0.0, 0.0);
            for n in 0..batch {
                // SAFETY: each channel's planes are written by its own task.
                let masked = unsafe { to.slice(plane(n, c), area) };
                let (x, g) = (&x[plane(n, c)..][..area], &grad_out[plane(n, c)..][..area]);
                let masked = if relu {
                    let mask = |(x, g): (&f32, &f32)| {
                        let y = (x - mean) * scale + beta[c];
                        if y > 0.0 { *g } else { 0.0 }
                    };
                    filled(masked, x.iter().zip(g).map(mask))
                } else {
                    masked.write_copy_of_slice(g)
                };
                let total = sum(masked);
                grad_beta += total;
                grad_gx += sum_product(masked, x) - mean * total;
            }
            let grad_gamma = grad_gx * inverse_std;
            let slope = grad_gamma * inverse_std / count;
            let offset = grad_beta / count;
            for n in 0..batch {
                // SAFETY: as above, and this task has just filled them.
                let gx = unsafe { to.slice(plane(n, c), area).assume_init_mut() };
                for (gx, x) in gx.iter_mut().zip(&x[plane(n, c)..][..area]) {
                    *gx = scale * (*gx - offset - (x - mean) * slope);
                }
            }
            (grad_gamma, grad_beta)
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise32 as noise;

    const N: usize = 3;
    const C: usize = 4;
    const AREA: usize = 35;

    /// The definition, in f64.
    fn exact(x: &[f64], gamma: &[f64], beta: &[f64], relu: bool) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for c in 0..C {
            let index = |n: usize, i: usize| (n * C + c) * AREA + i;
            let all = || (0..N).flat_map(|n| (0..AREA).map(move |i| (n, i)));
            let m = (N * AREA) as f64;
            let mean = all().map(|(n, i)| x[index(n, i)]).sum::<f64>() / m;
            let variance = all()
                .map(|(n, i)| (x[index(n, i)] - mean).powi(2))
                .sum::<f64>()
                / m;
            for (n, i) in all() {
                let hat = (x[index(n, i)] - mean) / (variance + 1e-5).sqrt();
                let v = gamma[c] * hat + beta[c];
                y[index(n, i)] = if relu { v.max(0.0) } else { v };
            }
        }
        y
    }

    fn widen(values: &[f32]) -> Vec<f64> {
        values.iter().map(|v| f64::from(*v)).collect()
    }

    /// Central differences of `loss` at `at` with a step of 1e-7 in f64, too small to move one of these values across the ReLU's kink.
    fn assert_gradient(name: &str, at: &[f64], gradient: &[f32], loss: &dyn Fn(&[f64]) -> f64) {
        for i in 0..at.len() {
            let mut moved = at.to_vec();
            moved[i] += 1e-7;
            let up = loss(&moved);
            moved[i] -= 2e-7;
            let numeric = (up - loss(&moved)) / 2e-7;
            let ours = f64::from(gradient[i]);
            assert!(
                (numeric - ours).abs() < 2e-5 * (1.0 + numeric.abs()),
                "{name}[{i}]: {ours} instead of {numeric}"
            );
        }
    }

    #[test]
    fn nan_stays_nan() {
        for relu in [false, true] {
            let mut y = [0.0; 4];
            batch_norm(
                &[f32::NAN, 1.0, 2.0, 3.0],
                &[1.0],
                &[0.0],
                4,
                1e-5,
                relu,
                &mut y,
            );
            assert!(y.iter().all(|y| y.is_nan()), "{relu}: {y:?}");
        }
    }

    #[test]
    fn equals_the_definition_and_its_finite_differences() {
        let x = noise(N * C * AREA, 1);
        let weights = noise(N * C * AREA, 2);
        let (gamma, beta) = ([1.1, 0.7, -0.4, 2.0], [0.1, -0.2, 0.3, 0.0]);
        let (x64, gamma64, beta64) = (widen(&x), widen(&gamma), widen(&beta));
        for relu in [false, true] {
            let mut y = vec![0.0; x.len()];
            let saved = batch_norm(&x, &gamma, &beta, AREA, 1e-5, relu, &mut y);
            for (a, b) in y.iter().zip(exact(&x64, &gamma64, &beta64, relu)) {
                assert!((f64::from(*a) - b).abs() < 1e-5, "{a} {b}");
            }
            let mut gx = vec![0.0; x.len()];
            let (ggamma, gbeta) = batch_norm_backward(
                &x, &gamma, &beta, &saved, &weights, AREA, 1e-5, relu, &mut gx,
            );
            let loss = |x: &[f64], gamma: &[f64], beta: &[f64]| -> f64 {
                let y = exact(x, gamma, beta, relu);
                y.iter().zip(&weights).map(|(y, w)| y * f64::from(*w)).sum()
            };
            assert_gradient("x", &x64, &gx, &|x| loss(x, &gamma64, &beta64));
            assert_gradient("gamma", &gamma64, &ggamma, &|g| loss(&x64, g, &beta64));
            assert_gradient("beta", &beta64, &gbeta, &|b| loss(&x64, &gamma64, b));
        }
    }
}
