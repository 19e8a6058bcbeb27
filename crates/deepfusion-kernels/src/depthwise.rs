//! Depthwise convolution: every channel has its own kernel.

use crate::lanes::sum_product;
use crate::sizes::product;
use rayon::prelude::*;
use std::ops::Range;

/// A depthwise convolution of N×C×H×W images at stride 1, padded with zeros so that it keeps the size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DepthwiseShape {
    /// Number of channels, C.
    pub channels: usize,
    /// Height, H.
    pub height: usize,
    /// Width, W.
    pub width: usize,
    /// Side of the kernels in pixels, odd.
    pub kernel: usize,
    /// Distance of the kernels' taps in pixels.
    pub dilation: usize,
}

/// A tap that reads some of the image: for which outputs, and where.
struct Tap {
    weight: usize,
    rows: Range<usize>,
    columns: Range<usize>,
    down: isize,
    right: isize,
}

impl DepthwiseShape {
    fn area(&self) -> usize {
        product([self.height, self.width])
    }

    fn weights(&self) -> usize {
        product([self.channels, self.kernel, self.kernel])
    }

    fn check(&self, x: usize, weight: usize, out: usize) {
        assert_eq!(self.kernel % 2, 1, "kernels have a centre");
        assert_eq!(weight, self.weights(), "weight length");
        assert_eq!(x, out, "output length");
        let image = product([self.channels, self.area()]);
        assert!(image > 0 && x.is_multiple_of(image), "whole images");
    }

    /// The taps that read any pixel; with `turned`, those of the transpose, which read on the opposite side.
    fn taps(&self, turned: bool) -> Vec<Tap> {
        let side = self.kernel as isize;
        let shift = |k: isize| {
            let shift = (k - side / 2) * self.dilation as isize;
            if turned { -shift } else { shift }
        };
        // Outputs whose input is within n pixels.
        let seen = |shift: isize, n: usize| {
            let n = n as isize;
            ((-shift).clamp(0, n) as usize)..((n - shift).clamp(0, n) as usize)
        };
        let mut taps = Vec::new();
        for ky in 0..side {
            for kx in 0..side {
                let (down, right) = (shift(ky), shift(kx));
                let rows = seen(down, self.height);
                let columns = seen(right, self.width);
                if !rows.is_empty() && !columns.is_empty() {
                    let weight = (ky * side + kx) as usize;
                    taps.push(Tap {
                        weight,
                        rows,
                        columns,
                        down,
                        right,
                    });
                }
            }
        }
        taps
    }

    /// The part of `plane`'s row that a tap reads for an output row.
    fn read<'a>(&self, plane: &'a [f32], tap: &Tap, y: usize) -> &'a [f32] {
        let row = y.strict_add_signed(tap.down) * self.width;
        &plane[row + tap.columns.start.strict_add_signed(tap.right)..][..tap.columns.len()]
    }

    fn sum(&self, x: &[f32], weight: &[f32], turned: bool, out: &mut [f32]) {
        self.check(x.len(), weight.len(), out.len());
        let (taps, side) = (self.taps(turned), self.kernel * self.kernel);
        out.par_chunks_mut(self.area())
            .zip(x.par_chunks(self.area()))
            .enumerate()
            .for_each(|(plane, (out, x))| {
                let weight = &weight[plane % self.channels * side..][..side];
                for (y, out) in out.chunks_exact_mut(self.width).enumerate() {
                    out.fill(0.0);
                    for tap in taps.iter().filter(|tap| tap.rows.contains(&y)) {
                        let factor = weight[tap.weight];
                        let out = &mut out[tap.columns.clone()];
                        for (out, x) in out.iter_mut().zip(self.read(x, tap, y)) {
                            *out += factor * x;
                        }
                    }
                }
            });
    }
}

/// `out[n, c] = weight[c] ⋆ x[n, c]`.
///
/// # Shapes
/// `x` and `out` N×C×H×W, `weight` C×k×k; `out` is overwritten.
///
/// # Panics
/// If a length does not match, or the kernels have an even side.
pub fn depthwise(shape: &DepthwiseShape, x: &[f32], weight: &[f32], out: &mut [f32]) {
    shape.sum(x, weight, false, out);
}

/// Gradient of the input of [`depthwise`].
///
/// # Shapes
/// `grad_out` and `grad_x` N×C×H×W, `weight` C×k×k; `grad_x` is overwritten.
///
/// # Panics
/// As [`depthwise`].
pub fn depthwise_backward_input(
    shape: &DepthwiseShape,
    weight: &[f32],
    grad_out: &[f32],
    grad_x: &mut [f32],
) {
    shape.sum(grad_out, weight, true, grad_x);
}

/// Gradient of the weights of [`depthwise`].
///
/// # Shapes
/// `x` and `grad_out` N×C×H×W, `grad_weight` C×k×k, overwritten.
///
/// # Panics
/// As [`depthwise`].
pub fn depthwise_backward_weight(
    shape: &DepthwiseShape,
    x: &[f32],
    grad_out: &[f32],
    grad_weight: &mut [f32],
) {
    shape.check(x.len(), grad_weight.len(), grad_out.len());
    let (area, side) = (shape.area(), shape.kernel * shape.kernel);
    let taps = shape.taps(false);
    let images = x.len() / (area * shape.channels);
    grad_weight
        .par_chunks_mut(side)
        .enumerate()
        .for_each(|(channel, grad_weight)| {
            grad_weight.fill(0.0);
            for tap in &taps {
                // Each row is summed separately, and rows are added in f64, so that few small numbers are rounded when added to a large
                // one.
                let mut total = 0.0;
                for image in 0..images {
                    let plane = (image * shape.channels + channel) * area;
                    let (x, grad) = (&x[plane..][..area], &grad_out[plane..][..area]);
                    for y in tap.rows.clone() {
                        let grad = &grad[y * shape.width..][tap.columns.clone()];
                        total += f64::from(sum_product(shape.read(x, tap, y), grad));
                    }
                }
                grad_weight[tap.weight] = total as f32;
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise32;

    const BATCH: usize = 2;

    /// Kernels smaller and larger than the image, wide and narrow images, a single pixel.
    const SHAPES: [(usize, usize, usize, usize, usize); 6] = [
        (3, 6, 9, 3, 1),
        (2, 5, 40, 3, 3),
        (4, 4, 3, 3, 6),
        (1, 1, 1, 5, 2),
        (5, 7, 17, 5, 2),
        (2, 3, 8, 1, 1),
    ];

    fn shapes() -> impl Iterator<Item = DepthwiseShape> {
        SHAPES.into_iter().map(
            |(channels, height, width, kernel, dilation)| DepthwiseShape {
                channels,
                height,
                width,
                kernel,
                dilation,
            },
        )
    }

    /// The definition, product by product.
    fn for_products(s: &DepthwiseShape, mut visit: impl FnMut(usize, usize, usize)) {
        let (h, w, half) = (s.height as isize, s.width as isize, s.kernel as isize / 2);
        for plane in 0..BATCH * s.channels {
            for y in 0..h {
                for x in 0..w {
                    for ky in 0..s.kernel as isize {
                        for kx in 0..s.kernel as isize {
                            let i = y + (ky - half) * s.dilation as isize;
                            let j = x + (kx - half) * s.dilation as isize;
                            if (0..h).contains(&i) && (0..w).contains(&j) {
                                let first = plane * s.area();
                                let tap = plane % s.channels * s.kernel * s.kernel
                                    + (ky * s.kernel as isize + kx) as usize;
                                let at = |y: isize, x: isize| first + (y * w + x) as usize;
                                visit(at(y, x), at(i, j), tap);
                            }
                        }
                    }
                }
            }
        }
    }

    fn close(found: &[f32], exact: &[f64], what: &str) {
        for (i, (a, b)) in found.iter().zip(exact).enumerate() {
            assert!((f64::from(*a) - b).abs() < 1e-5, "{what} {i}: {a} for {b}");
        }
    }

    /// The gradient of a sum of products is exact here: ∂/∂a of Σ a·b·g is Σ b·g. It equals finite differences, which another test below
    /// checks.
    #[test]
    fn values_and_gradients_equal_the_definition() {
        for shape in shapes() {
            let len = BATCH * shape.channels * shape.area();
            let (x, grad) = (noise32(len, 1), noise32(len, 2));
            let weight = noise32(shape.weights(), 3);
            let (mut exact, mut exact_x) = (vec![0.0; len], vec![0.0; len]);
            let mut exact_weight = vec![0.0; weight.len()];
            for_products(&shape, |to, from, tap| {
                let [x, w, g] = [x[from], weight[tap], grad[to]].map(f64::from);
                exact[to] += w * x;
                exact_x[from] += w * g;
                exact_weight[tap] += x * g;
            });
            let mut out = vec![7.0; len];
            depthwise(&shape, &x, &weight, &mut out);
            close(&out, &exact, "output");
            depthwise_backward_input(&shape, &weight, &grad, &mut out);
            close(&out, &exact_x, "input's gradient");
            let mut out = vec![7.0; weight.len()];
            depthwise_backward_weight(&shape, &x, &grad, &mut out);
            close(&out, &exact_weight, "weights' gradient");
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for shape in shapes() {
            let len = BATCH * shape.channels * shape.area();
            let (x, grad) = (noise32(len, 4), noise32(len, 5));
            let weight = noise32(shape.weights(), 6);
            let loss = |x: &[f32], weight: &[f32]| {
                let mut out = vec![0.0; len];
                depthwise(&shape, x, weight, &mut out);
                let products = out.iter().zip(&grad);
                products
                    .map(|(a, b)| f64::from(*a) * f64::from(*b))
                    .sum::<f64>()
            };
            let (mut of_x, mut of_weight) = (vec![0.0; len], vec![0.0; weight.len()]);
            depthwise_backward_input(&shape, &weight, &grad, &mut of_x);
            depthwise_backward_weight(&shape, &x, &grad, &mut of_weight);
            // Linear in each argument, so a large step has no error but rounding.
            let check = |at: usize, values: &[f32], gradient: f32, f: &dyn Fn(&[f32]) -> f64| {
                let moved = |by: f32| {
                    let mut values = values.to_vec();
                    values[at] += by;
                    f(&values)
                };
                let numeric = (moved(0.5) - moved(-0.5)) / 1.0;
                assert!(
                    (numeric - f64::from(gradient)).abs() < 1e-5,
                    "{shape:?} {at}"
                );
            };
            for at in (0..len).step_by((len / 7).max(1)) {
                check(at, &x, of_x[at], &|x| loss(x, &weight));
            }
            for at in 0..weight.len() {
                check(at, &weight, of_weight[at], &|weight| loss(&x, weight));
            }
        }
    }
}
