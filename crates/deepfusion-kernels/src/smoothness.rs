//! Edge-aware smoothness of a disparity (the paper's Eq. 8).
//!
//! L = mean|∂ₓd*|·e^(−|∂ₓI|) + mean|∂ᵧd*|·e^(−|∂ᵧI|), where d* is d divided by its mean in the image, and |∂I| is averaged over channels.
//! d* is never computed: the sum is divided by the mean.

use crate::{activation::exp_negative, lanes::sum};
use rayon::prelude::*;

/// Keeps the quotient finite if the disparity is zero everywhere.
const EPSILON: f32 = 1e-7;

/// The sizes of a smoothness term.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SmoothnessShape {
    /// Number of images, N.
    pub batch: usize,
    /// Number of channels of the image, C.
    pub channels: usize,
    /// Height, H.
    pub height: usize,
    /// Width, W.
    pub width: usize,
}

impl SmoothnessShape {
    fn area(&self) -> usize {
        self.height * self.width
    }

    /// Number of differences along x and along y, over all images.
    fn counts(&self) -> (f32, f32) {
        let count = |n: usize| (self.batch * n).max(1) as f32;
        (
            count(self.height * (self.width - 1)),
            count((self.height - 1) * self.width),
        )
    }

    fn check(&self, disparity: usize, image: usize) {
        assert!(self.area() > 0 && self.channels > 0, "images have pixels");
        assert_eq!(
            disparity,
            self.batch * self.area(),
            "one disparity per pixel"
        );
        assert_eq!(image, disparity * self.channels, "channels of every pixel");
    }

    /// Writes e^(−mean over channels of |I(p + step) − I(p)|) for the first `out.len()` pixels from `start`.
    fn weights(&self, image: &[f32], start: usize, step: usize, out: &mut [f32]) {
        out.fill(0.0);
        for plane in image.chunks_exact(self.area()) {
            let here = &plane[start..][..out.len()];
            let there = &plane[start + step..][..out.len()];
            for ((out, a), b) in out.iter_mut().zip(here).zip(there) {
                *out += (b - a).abs();
            }
        }
        let scale = -1.0 / self.channels as f32;
        for out in out {
            *out = exp_negative(*out * scale);
        }
    }

    /// Calls `visit(pixels, step, weights)` for every row of an image: once for the differences along x,
    /// once for those along y.
    fn rows(&self, image: &[f32], mut visit: impl FnMut(usize, usize, &[f32])) {
        let mut weights = vec![0.0; self.width];
        for y in 0..self.height {
            let start = y * self.width;
            let right = &mut weights[..self.width - 1];
            self.weights(image, start, 1, right);
            visit(start, 1, right);
            if y + 1 < self.height {
                self.weights(image, start, self.width, &mut weights);
                visit(start, self.width, &weights);
            }
        }
    }

    /// The sum of an image's weighted differences, each over its count.
    fn image_sum(&self, disparity: &[f32], image: &[f32]) -> f32 {
        let (along_x, along_y) = self.counts();
        let mut total = 0.0_f64;
        let mut terms = vec![0.0; self.width];
        self.rows(image, |start, step, weights| {
            let count = if step == 1 { along_x } else { along_y };
            let terms = &mut terms[..weights.len()];
            let here = &disparity[start..][..weights.len()];
            let there = &disparity[start + step..][..weights.len()];
            for (((term, a), b), w) in terms.iter_mut().zip(here).zip(there).zip(weights) {
                *term = (b - a).abs() * w;
            }
            total += f64::from(sum(terms) / count);
        });
        total as f32
    }

    fn mean(&self, disparity: &[f32]) -> f32 {
        sum(disparity) / self.area() as f32 + EPSILON
    }
}

/// The smoothness term of a batch.
///
/// # Shapes
/// `disparity` N×1×H×W, `image` N×C×H×W.
///
/// # Panics
/// If a length does not match.
#[must_use]
pub fn smoothness(shape: &SmoothnessShape, disparity: &[f32], image: &[f32]) -> f32 {
    shape.check(disparity.len(), image.len());
    let area = shape.area();
    let images = image.par_chunks(shape.channels * area);
    let sums: Vec<f32> = disparity
        .par_chunks(area)
        .zip(images)
        .map(|(d, image)| shape.image_sum(d, image) / shape.mean(d))
        .collect();
    sums.iter().sum()
}

/// Gradient of [`smoothness`] with respect to the disparity, times `grad`.
///
/// # Shapes
/// As for [`smoothness`]; `grad_disparity` N×1×H×W, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn smoothness_backward(
    shape: &SmoothnessShape,
    disparity: &[f32],
    image: &[f32],
    grad: f32,
    grad_disparity: &mut [f32],
) {
    shape.check(disparity.len(), image.len());
    let area = shape.area();
    let (along_x, along_y) = shape.counts();
    grad_disparity
        .par_chunks_mut(area)
        .zip(disparity.par_chunks(area))
        .zip(image.par_chunks(shape.channels * area))
        .for_each(|((to, d), image)| {
            let mean = shape.mean(d);
            // Through the mean, to which every pixel contributes equally.
            let through_mean = -grad * shape.image_sum(d, image) / (mean * mean * area as f32);
            to.fill(through_mean);
            let mut terms = vec![0.0; shape.width];
            shape.rows(image, |start, step, weights| {
                let count = if step == 1 { along_x } else { along_y };
                let factor = grad / (count * mean);
                let terms = &mut terms[..weights.len()];
                let here = &d[start..][..weights.len()];
                let there = &d[start + step..][..weights.len()];
                for (((term, a), b), w) in terms.iter_mut().zip(here).zip(there).zip(weights) {
                    let sign = f32::from(u8::from(b > a)) - f32::from(u8::from(b < a));
                    *term = sign * w * factor;
                }
                for (to, term) in to[start + step..].iter_mut().zip(&*terms) {
                    *to += term;
                }
                for (to, term) in to[start..].iter_mut().zip(&*terms) {
                    *to -= term;
                }
            });
        });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise32;

    const SHAPE: SmoothnessShape = SmoothnessShape {
        batch: 2,
        channels: 3,
        height: 4,
        width: 7,
    };

    fn inputs() -> (Vec<f32>, Vec<f32>) {
        let disparity = noise32(56, 3).iter().map(|v| v + 0.7).collect();
        (disparity, noise32(168, 4))
    }

    #[test]
    fn equals_the_definition() {
        let (disparity, image) = inputs();
        let (mut along_x, mut along_y) = (0.0_f64, 0.0_f64);
        for n in 0..2 {
            let d = |y: usize, x: usize| f64::from(disparity[n * 28 + y * 7 + x]);
            let i = |c: usize, y: usize, x: usize| f64::from(image[(n * 3 + c) * 28 + y * 7 + x]);
            let mean = disparity[n * 28..][..28]
                .iter()
                .map(|v| f64::from(*v))
                .sum::<f64>()
                / 28.0;
            for y in 0..4 {
                for x in 0..7 {
                    let edge = |y1: usize, x1: usize| {
                        (-(0..3)
                            .map(|c| (i(c, y1, x1) - i(c, y, x)).abs())
                            .sum::<f64>()
                            / 3.0)
                            .exp()
                    };
                    if x < 6 {
                        along_x += (d(y, x + 1) - d(y, x)).abs() / mean * edge(y, x + 1);
                    }
                    if y < 3 {
                        along_y += (d(y + 1, x) - d(y, x)).abs() / mean * edge(y + 1, x);
                    }
                }
            }
        }
        let exact = along_x / 48.0 + along_y / 42.0;
        let ours = f64::from(smoothness(&SHAPE, &disparity, &image));
        assert!((ours - exact).abs() < 1e-5 * exact, "{ours} {exact}");
    }

    /// Central differences with step 1e-3, away from the kinks. The factor 30 gives gradients of up to 4 and a loss of 24, which f32
    /// resolves to 1e-6: divided by twice the step, that is an error of 1e-3, and 2.4e-3 was measured.
    #[test]
    fn gradient_equals_finite_differences() {
        let (disparity, image) = inputs();
        let mut gradient = vec![f32::NAN; 56];
        smoothness_backward(&SHAPE, &disparity, &image, 30.0, &mut gradient);
        for i in 0..56 {
            let at = |step: f32| {
                let mut moved = disparity.clone();
                moved[i] += step;
                30.0 * smoothness(&SHAPE, &moved, &image)
            };
            let numeric = (at(1e-3) - at(-1e-3)) / 2e-3;
            assert!(
                (numeric - gradient[i]).abs() < 5e-3,
                "{i}: {numeric} {}",
                gradient[i]
            );
        }
    }
}
