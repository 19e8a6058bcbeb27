//! Local correlation: the similarity of each pixel's feature to those around the same pixel in another image.
//!
//! out(d, p) = (1/C) Σ_c a(c, p)·b(c, p + d) for every displacement d of at most r pixels along each axis; b is zero outside of its image.
//! Displacements are ordered row by row: channel (d_y + r)·(2r + 1) + (d_x + r).

mod product;
#[cfg(test)]
mod tests;

use crate::scratch::with_scratch;
use crate::send_ptr::SharedMut;
use crate::sizes::product;
use product::{DisplacementSums, LANES, RowCorrelation};
use pulp::Arch;
use rayon::prelude::*;

/// The sizes of a local correlation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CorrelationShape {
    /// Number of channels of both images, C.
    pub channels: usize,
    /// Height of both images.
    pub height: usize,
    /// Width of both images.
    pub width: usize,
    /// The largest displacement along each axis, r, in pixels.
    pub radius: usize,
}

/// Number of rows copied by one task.
const ROWS_AT_ONCE: usize = 64;

impl CorrelationShape {
    /// Number of displacements along one axis, 2r + 1.
    fn side(&self) -> usize {
        2 * self.radius + 1
    }

    /// Number of output channels, (2r + 1)².
    #[must_use]
    pub fn displacements(&self) -> usize {
        product([self.side(), self.side()])
    }

    fn area(&self) -> usize {
        product([self.height, self.width])
    }

    /// Distance from one padded row to the next: whole vectors, with zeros on both sides.
    fn stride(&self) -> usize {
        self.width.next_multiple_of(LANES) + 2 * self.radius
    }

    /// Distance from one padded plane to the next.
    fn plane(&self) -> usize {
        product([self.height, self.stride()])
    }

    /// Number of images in a batch.
    fn batch(&self, image: usize, out: usize) -> usize {
        let size = product([self.channels, self.area()]);
        assert!(size > 0, "images have pixels");
        assert_eq!(image % size, 0, "whole images");
        let batch = image / size;
        let expected = product([batch, self.displacements(), self.area()]);
        assert_eq!(out, expected, "one output per displacement and pixel");
        batch
    }

    /// Lends `work` a copy of the planes with `radius` zeros before each row and at least as many after it.
    fn padded<R>(&self, planes: &[f32], work: impl FnOnce(&[f32]) -> R) -> R {
        let (stride, radius) = (self.stride(), self.radius);
        with_scratch(product([planes.len() / self.width, stride]), |to| {
            to.par_chunks_mut(stride)
                .zip(planes.par_chunks(self.width))
                .with_min_len(ROWS_AT_ONCE)
                .for_each(|(to, from)| {
                    to[..radius].fill(0.0);
                    to[radius..][..from.len()].copy_from_slice(from);
                    to[radius + from.len()..].fill(0.0);
                });
            work(to)
        })
    }

    /// 1/C.
    fn share(&self) -> f32 {
        1.0 / self.channels as f32
    }
}

/// out(d, p) = (1/C) Σ_c first(c, p)·second(c, p + d).
///
/// # Shapes
/// `first`, `second` N×C×H×W, `out` N×(2r + 1)²×H×W.
///
/// # Panics
/// If a length does not match.
pub fn local_correlation(shape: &CorrelationShape, first: &[f32], second: &[f32], out: &mut [f32]) {
    let batch = shape.batch(first.len(), out.len());
    assert_eq!(first.len(), second.len(), "both images have the same size");
    let (height, radius, side) = (shape.height, shape.radius, shape.side());
    let to = SharedMut::new(out);
    let correlate = |first: &[f32], second: &[f32]| {
        // A task takes one row of the second image, which is compared with 2r + 1 rows of the first. Rows outside the image are tasks, too:
        // they write the outputs of displacements that leave the image.
        let rows = height + 2 * radius;
        (0..batch * rows).into_par_iter().for_each(|task| {
            let (n, beyond) = (task / rows, task % rows);
            let image = n * shape.channels * shape.plane();
            // Row y of the first image is d_y = y₂ − y above; with y₂ + r = `beyond`, d_y + r = `beyond` − y.
            let pairs = (0..side).filter_map(|down| {
                let y = beyond.checked_sub(down).filter(|&y| y < height)?;
                let outputs = (n * side + down) * side * height + y;
                Some((image + y * shape.stride() + radius, outputs * shape.width))
            });
            match beyond.checked_sub(radius).filter(|&y| y < height) {
                Some(y) => Arch::new().dispatch(RowCorrelation {
                    shape,
                    pairs: &pairs.collect::<Vec<_>>(),
                    first,
                    second: &second[image + y * shape.stride()..],
                    out: to,
                }),
                None => pairs.for_each(|(_, outputs)| {
                    for right in 0..side {
                        // SAFETY: every output row belongs to one row of the second image.
                        unsafe { to.slice(outputs + right * shape.area(), shape.width) }.fill(0.0);
                    }
                }),
            }
        });
    };
    shape.padded(first, |first| {
        shape.padded(second, |second| correlate(first, second));
    });
}

/// Gradient of [`local_correlation`] with respect to its first image.
///
/// # Shapes
/// As for [`local_correlation`]; `grad_first` N×C×H×W, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn local_correlation_backward_first(
    shape: &CorrelationShape,
    second: &[f32],
    grad_out: &[f32],
    grad_first: &mut [f32],
) {
    // Σ_d grad(d, p)·second(p + d).
    sum_displacements(shape, second, grad_out, grad_first, |y, down, right| {
        let other = (y + down).checked_sub(shape.radius)?;
        (other < shape.height).then_some(Tap {
            grad: (y, shape.radius),
            other: (other, right),
        })
    });
}

/// Gradient of [`local_correlation`] with respect to its second image.
///
/// # Shapes
/// As for [`local_correlation`]; `grad_second` N×C×H×W, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn local_correlation_backward_second(
    shape: &CorrelationShape,
    first: &[f32],
    grad_out: &[f32],
    grad_second: &mut [f32],
) {
    // Σ_d grad(d, p − d)·first(p − d).
    sum_displacements(shape, first, grad_out, grad_second, |y, down, right| {
        let other = (y + shape.radius).checked_sub(down)?;
        let from = (other, 2 * shape.radius - right);
        (other < shape.height).then_some(Tap {
            grad: from,
            other: from,
        })
    });
}

/// Offsets of one displacement's products for the first pixel of a row: its row, and its column in the padded copies.
struct Tap {
    grad: (usize, usize),
    other: (usize, usize),
}

/// out(c, p) = (1/C) Σ_d grad(d, ·)·other(c, ·), read at the offsets that `tap(row of p, d_y + r, d_x + r)` returns.
fn sum_displacements(
    shape: &CorrelationShape,
    other: &[f32],
    grad: &[f32],
    out: &mut [f32],
    tap: impl Fn(usize, usize, usize) -> Option<Tap> + Sync,
) {
    let batch = shape.batch(other.len(), grad.len());
    assert_eq!(out.len(), other.len(), "gradient length");
    let (height, side) = (shape.height, shape.side());
    let at = |(row, column): (usize, usize)| row * shape.stride() + column;
    let to = SharedMut::new(out);
    let sum = |grad: &[f32], other: &[f32]| {
        (0..batch * height).into_par_iter().for_each(|task| {
            let (n, y) = (task / height, task % height);
            let taps: Vec<_> = (0..shape.displacements())
                .filter_map(|d| {
                    let tap = tap(y, d / side, d % side)?;
                    Some((d * shape.plane() + at(tap.grad), at(tap.other)))
                })
                .collect();
            Arch::new().dispatch(DisplacementSums {
                shape,
                taps: &taps,
                grad: &grad[n * shape.displacements() * shape.plane()..],
                other: &other[n * shape.channels * shape.plane()..],
                out: to,
                start: n * shape.channels * shape.area() + y * shape.width,
            });
        });
    };
    shape.padded(grad, |grad| shape.padded(other, |other| sum(grad, other)));
}
