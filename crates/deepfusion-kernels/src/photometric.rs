//! The photometric error (the paper's Eq. 6).

use crate::box_filter::{adjoint3x3, mean3x3};
use num_traits::Float;
use rayon::prelude::*;

/// The first constant of SSIM, (0.01·L)² for values up to L = 1, which stabilises the quotient of the means.
pub const SSIM_C1: f64 = 1e-4;
/// The second constant of SSIM, (0.03·L)², which stabilises the quotient of the variances.
pub const SSIM_C2: f64 = 9e-4;

/// Sizes and weights of the photometric error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotometricShape {
    /// Channels, C.
    pub channels: usize,
    /// Height, at least 2.
    pub height: usize,
    /// Width, at least 2.
    pub width: usize,
    /// Weight of the structural term; the rest is the weight of the absolute difference.
    pub alpha: f64,
}

/// Intermediate planes for one channel.
struct Planes<T> {
    mean_a: Vec<T>,
    mean_b: Vec<T>,
    mean_aa: Vec<T>,
    mean_bb: Vec<T>,
    mean_ab: Vec<T>,
    product: Vec<T>,
    rows: Vec<T>,
}

impl<T: Float> Planes<T> {
    fn new(area: usize) -> Self {
        let plane = || vec![T::zero(); area];
        Self {
            mean_a: plane(),
            mean_b: plane(),
            mean_aa: plane(),
            mean_bb: plane(),
            mean_ab: plane(),
            product: plane(),
            rows: plane(),
        }
    }

    fn fill(&mut self, a: &[T], b: &[T], width: usize) {
        mean3x3(a, width, &mut self.rows, &mut self.mean_a);
        mean3x3(b, width, &mut self.rows, &mut self.mean_b);
        for (left, right, to) in [
            (a, a, &mut self.mean_aa),
            (b, b, &mut self.mean_bb),
            (a, b, &mut self.mean_ab),
        ] {
            for ((p, l), r) in self.product.iter_mut().zip(left).zip(right) {
                *p = *l * *r;
            }
            mean3x3(&self.product, width, &mut self.rows, to);
        }
    }
}

/// The terms of SSIM = a1·a2/(b1·b2) at a pixel.
struct Terms<T> {
    a1: T,
    a2: T,
    b1: T,
    b2: T,
}

impl<T: Float> Terms<T> {
    #[inline]
    fn new(mu_a: T, mu_b: T, aa: T, bb: T, ab: T) -> Self {
        let (c1, c2) = (constant::<T>(SSIM_C1), constant::<T>(SSIM_C2));
        let two = T::one() + T::one();
        Self {
            a1: two * mu_a * mu_b + c1,
            a2: two * (ab - mu_a * mu_b) + c2,
            b1: mu_a * mu_a + mu_b * mu_b + c1,
            b2: (aa - mu_a * mu_a) + (bb - mu_b * mu_b) + c2,
        }
    }

    #[inline]
    fn ssim(&self) -> T {
        (self.a1 * self.a2) / (self.b1 * self.b2)
    }
}

#[inline]
fn constant<T: Float>(value: f64) -> T {
    T::from(value).unwrap_or_else(T::nan)
}

impl PhotometricShape {
    fn area(&self) -> usize {
        self.height * self.width
    }

    fn check(&self, a: usize, b: usize, out: usize) {
        assert!(
            self.height > 1 && self.width > 1,
            "3×3 windows mirror at least 2×2 pixels"
        );
        assert_eq!(a, b, "both images have the same size");
        assert_eq!(a % (self.channels * self.area()), 0, "whole images");
        assert_eq!(out * self.channels, a, "one error per pixel");
    }
}

/// pe(a, b) = mean over channels of α·clamp((1 − SSIM(a, b))/2, 0, 1) + (1 − α)·|a − b|.
///
/// # Shapes
/// `a`, `b` N×C×H×W, `out` N×1×H×W.
///
/// # Panics
/// If a length does not match, or a side is below 2.
pub fn photometric_error<T: Float + Send + Sync>(
    shape: &PhotometricShape,
    a: &[T],
    b: &[T],
    out: &mut [T],
) {
    shape.check(a.len(), b.len(), out.len());
    let area = shape.area();
    let image = shape.channels * area;
    let alpha = constant::<T>(shape.alpha / shape.channels as f64);
    let beta = constant::<T>((1.0 - shape.alpha) / shape.channels as f64);
    let half = constant::<T>(0.5);
    out.par_chunks_mut(area)
        .zip(a.par_chunks(image).zip(b.par_chunks(image)))
        .for_each_init(
            || Planes::new(area),
            |planes, (out, (a, b))| {
                out.fill(T::zero());
                for (a, b) in a.chunks_exact(area).zip(b.chunks_exact(area)) {
                    planes.fill(a, b, shape.width);
                    let means = planes.mean_a.iter().zip(&planes.mean_b);
                    let squares = planes.mean_aa.iter().zip(&planes.mean_bb);
                    let inputs = a.iter().zip(b);
                    for (((((out, (mu_a, mu_b)), (aa, bb)), ab), a), b) in out
                        .iter_mut()
                        .zip(means)
                        .zip(squares)
                        .zip(&planes.mean_ab)
                        .zip(inputs.clone().map(|(a, _)| a))
                        .zip(inputs.map(|(_, b)| b))
                    {
                        let ssim = Terms::new(*mu_a, *mu_b, *aa, *bb, *ab).ssim();
                        let dissimilar = ((T::one() - ssim) * half).max(T::zero()).min(T::one());
                        *out = *out + alpha * dissimilar + beta * (*a - *b).abs();
                    }
                }
            },
        );
}

/// Gradient of [`photometric_error`] with respect to `a`.
///
/// # Shapes
/// `a`, `b`, `grad_a` N×C×H×W, `grad_out` N×1×H×W; `grad_a` is overwritten.
///
/// # Panics
/// If a length does not match, or a side is below 2.
pub fn photometric_error_backward<T: Float + Send + Sync>(
    shape: &PhotometricShape,
    a: &[T],
    b: &[T],
    grad_out: &[T],
    grad_a: &mut [T],
) {
    shape.check(a.len(), b.len(), grad_out.len());
    assert_eq!(grad_a.len(), a.len(), "input gradient length");
    let area = shape.area();
    let image = shape.channels * area;
    let alpha = constant::<T>(-0.5 * shape.alpha / shape.channels as f64);
    let beta = constant::<T>((1.0 - shape.alpha) / shape.channels as f64);
    let two = T::one() + T::one();
    let images = a.par_chunks(image).zip(b.par_chunks(image));
    grad_a
        .par_chunks_mut(image)
        .zip(images.zip(grad_out.par_chunks(area)))
        .for_each_init(
            || Planes::new(area),
            |planes, (grad_a, ((a, b), grad))| {
                let channels = a.chunks_exact(area).zip(b.chunks_exact(area));
                for (grad_a, (a, b)) in grad_a.chunks_exact_mut(area).zip(channels) {
                    planes.fill(a, b, shape.width);
                    for i in 0..area {
                        let (mu_a, mu_b) = (planes.mean_a[i], planes.mean_b[i]);
                        let t = Terms::new(
                            mu_a,
                            mu_b,
                            planes.mean_aa[i],
                            planes.mean_bb[i],
                            planes.mean_ab[i],
                        );
                        let ssim = t.ssim();
                        // Where the value is clamped, the gradient is zero.
                        let inside = ssim < T::one() && ssim > -T::one();
                        let g = if inside { alpha * grad[i] } else { T::zero() };
                        let denominator = t.b1 * t.b2;
                        // ∂SSIM/∂μ_a, ∂SSIM/∂E[a²], ∂SSIM/∂E[ab]; they replace the planes they were computed from.
                        let d_mean = two * mu_b * (t.a2 - t.a1) / denominator
                            - ssim * two * mu_a * (T::one() / t.b1 - T::one() / t.b2);
                        planes.mean_a[i] = g * d_mean;
                        planes.mean_aa[i] = -g * ssim / t.b2;
                        planes.mean_ab[i] = g * two * t.a1 / denominator;
                    }
                    adjoint3x3(
                        &planes.mean_a,
                        shape.width,
                        &mut planes.rows,
                        &mut planes.product,
                    );
                    adjoint3x3(
                        &planes.mean_aa,
                        shape.width,
                        &mut planes.rows,
                        &mut planes.mean_b,
                    );
                    adjoint3x3(
                        &planes.mean_ab,
                        shape.width,
                        &mut planes.rows,
                        &mut planes.mean_bb,
                    );
                    for i in 0..area {
                        let difference = a[i] - b[i];
                        let sign = if difference > T::zero() {
                            T::one()
                        } else if difference < T::zero() {
                            -T::one()
                        } else {
                            T::zero()
                        };
                        grad_a[i] = planes.product[i]
                            + two * a[i] * planes.mean_b[i]
                            + b[i] * planes.mean_bb[i]
                            + beta * grad[i] * sign;
                    }
                }
            },
        );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    const SHAPE: PhotometricShape = PhotometricShape {
        channels: 3,
        height: 5,
        width: 7,
        alpha: 0.85,
    };

    /// SSIM from its definition at one pixel, with explicit mirrored windows.
    fn by_definition(a: &[f64], b: &[f64], y: usize, x: usize) -> f64 {
        let mirror = |i: isize, n: usize| -> usize {
            if i < 0 {
                1
            } else if i as usize == n {
                n - 2
            } else {
                i as usize
            }
        };
        let (h, w) = (SHAPE.height, SHAPE.width);
        let mut total = 0.0;
        for c in 0..3 {
            let mut window = Vec::new();
            for dy in -1..=1isize {
                for dx in -1..=1isize {
                    let (yy, xx) = (mirror(y as isize + dy, h), mirror(x as isize + dx, w));
                    let i = (c * h + yy) * w + xx;
                    window.push((a[i], b[i]));
                }
            }
            let mean = |f: &dyn Fn(&(f64, f64)) -> f64| window.iter().map(f).sum::<f64>() / 9.0;
            let (ma, mb) = (mean(&|p| p.0), mean(&|p| p.1));
            let va = mean(&|p| (p.0 - ma).powi(2));
            let vb = mean(&|p| (p.1 - mb).powi(2));
            let cov = mean(&|p| (p.0 - ma) * (p.1 - mb));
            let ssim = (2.0 * ma * mb + 1e-4) * (2.0 * cov + 9e-4)
                / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
            let i = (c * h + y) * w + x;
            total += 0.85 * ((1.0 - ssim) / 2.0).clamp(0.0, 1.0) + 0.15 * (a[i] - b[i]).abs();
        }
        total / 3.0
    }

    #[test]
    fn equals_the_definition() {
        let (a, b) = (noise(2 * 105, 1), noise(2 * 105, 2));
        let mut out = vec![0.0; 70];
        photometric_error(&SHAPE, &a, &b, &mut out);
        for n in 0..2 {
            for y in 0..5 {
                for x in 0..7 {
                    let exact = by_definition(&a[n * 105..], &b[n * 105..], y, x);
                    assert!((out[n * 35 + y * 7 + x] - exact).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn identical_images_have_no_error() {
        let a = noise(105, 3);
        let mut out = vec![1.0; 35];
        photometric_error(&SHAPE, &a, &a, &mut out);
        assert!(out.iter().all(|e| e.abs() < 1e-12));
    }

    /// Random images are not at the kinks: |a − b| > 1e-5 and SSIM within (−1, 1).
    #[test]
    fn gradient_equals_finite_differences() {
        let (a, b, weights) = (noise(2 * 105, 4), noise(2 * 105, 5), noise(70, 6));
        let loss = |a: &[f64]| {
            let mut out = vec![0.0; 70];
            photometric_error(&SHAPE, a, &b, &mut out);
            out.iter().zip(&weights).map(|(e, w)| e * w).sum::<f64>()
        };
        let mut gradient = vec![0.0; a.len()];
        photometric_error_backward(&SHAPE, &a, &b, &weights, &mut gradient);
        for i in 0..a.len() {
            let mut moved = a.clone();
            moved[i] += 1e-6;
            let up = loss(&moved);
            moved[i] -= 2e-6;
            let numeric = (up - loss(&moved)) / 2e-6;
            assert!(
                (numeric - gradient[i]).abs() < 1e-6 * (1.0 + numeric.abs()),
                "{i}"
            );
        }
    }
}
