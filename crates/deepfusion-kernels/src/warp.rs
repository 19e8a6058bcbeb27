//! The bilinear warp: reads an image at given pixel coordinates (SPEC 0 and 2).
//!
//! Coordinates address pixel centres at integers; outside the image the border pixel counts. Where a
//! coordinate was moved to the border, the output does not depend on it and its gradient is zero.

use num_traits::Float;
use rayon::prelude::*;

/// The sizes of a warp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WarpShape {
    /// Channels of the image, C.
    pub channels: usize,
    /// Height of the image that is read.
    pub in_height: usize,
    /// Width of the image that is read.
    pub in_width: usize,
    /// Pixels of the output, H'·W'.
    pub out_area: usize,
}

/// The four neighbours of a coordinate, and how far it lies between them.
#[derive(Clone, Copy)]
struct Sample<T> {
    top_left: usize,
    right: usize,
    down: usize,
    x: T,
    y: T,
    /// Whether moving the coordinate along x (y) moves the sample.
    free_x: bool,
    free_y: bool,
}

impl WarpShape {
    fn in_area(&self) -> usize {
        self.in_height * self.in_width
    }

    #[inline]
    fn sample<T: Float>(&self, u: T, v: T) -> Sample<T> {
        let axis = |p: T, size: usize| {
            let last = T::from(size - 1).unwrap_or_else(T::zero);
            // A NaN coordinate reads pixel 0: `max` returns the number.
            let inside = p.max(T::zero()).min(last);
            let low = inside.floor().min((last - T::one()).max(T::zero()));
            let free = p >= T::zero() && p <= last;
            (low.to_usize().unwrap_or(0), inside - low, free)
        };
        let (x0, x, free_x) = axis(u, self.in_width);
        let (y0, y, free_y) = axis(v, self.in_height);
        Sample {
            top_left: y0 * self.in_width + x0,
            right: usize::from(self.in_width > 1),
            down: if self.in_height > 1 { self.in_width } else { 0 },
            x,
            y,
            free_x,
            free_y,
        }
    }

    fn check(&self, image: usize, coords: usize, out: usize) {
        assert!(
            self.in_area() > 0 && self.out_area > 0,
            "images have pixels"
        );
        assert_eq!(image % (self.channels * self.in_area()), 0, "whole images");
        let batch = image / (self.channels * self.in_area());
        assert_eq!(coords, batch * 2 * self.out_area, "two coordinates a pixel");
        assert_eq!(out, batch * self.channels * self.out_area, "output length");
    }
}

/// Pixels handled by one task.
const CHUNK: usize = 4096;

/// out(p) = image⟨coords(p)⟩, bilinear.
///
/// # Shapes
/// `image` N×C×H×W, `coords` N×2×H'×W' (u, then v, in pixels), `out` N×C×H'×W'.
///
/// # Panics
/// When a length does not fit.
pub fn warp<T: Float + Send + Sync>(shape: &WarpShape, image: &[T], coords: &[T], out: &mut [T]) {
    shape.check(image.len(), coords.len(), out.len());
    let (area, channels) = (shape.out_area, shape.channels);
    let to = crate::send_ptr::SharedMut::new(out);
    for_chunks(shape, coords, |n, range, us, vs| {
        let image = &image[n * channels * shape.in_area()..];
        for (i, (u, v)) in us.iter().zip(vs).enumerate() {
            let s = shape.sample(*u, *v);
            for c in 0..channels {
                let plane = &image[c * shape.in_area() + s.top_left..];
                let (a, b) = (plane[0], plane[s.right]);
                let (c0, d) = (plane[s.down], plane[s.down + s.right]);
                let (top, bottom) = (a + (b - a) * s.x, c0 + (d - c0) * s.x);
                let at = (n * channels + c) * area + range.start + i;
                // SAFETY: pixel ranges of different tasks do not overlap.
                unsafe { *to.at(at) = top + (bottom - top) * s.y };
            }
        }
    });
}

/// Runs `work(image index, pixel range, u of the range, v of the range)` over all pixels.
fn for_chunks<T: Float + Send + Sync>(
    shape: &WarpShape,
    coords: &[T],
    work: impl Fn(usize, std::ops::Range<usize>, &[T], &[T]) + Sync,
) {
    let area = shape.out_area;
    let chunks = area.div_ceil(CHUNK);
    let batch = coords.len() / (2 * area);
    (0..batch * chunks).into_par_iter().for_each(|task| {
        let (n, start) = (task / chunks, task % chunks * CHUNK);
        let range = start..(start + CHUNK).min(area);
        let us = &coords[2 * n * area..][range.clone()];
        let vs = &coords[(2 * n + 1) * area..][range.clone()];
        work(n, range, us, vs);
    });
}

/// Gradient of [`warp`] with respect to the coordinates.
///
/// # Shapes
/// As [`warp`]; `grad_out` N×C×H'×W', `grad_coords` N×2×H'×W', overwritten.
///
/// # Panics
/// When a length does not fit.
pub fn warp_backward_coords<T: Float + Send + Sync>(
    shape: &WarpShape,
    image: &[T],
    coords: &[T],
    grad_out: &[T],
    grad_coords: &mut [T],
) {
    shape.check(image.len(), coords.len(), grad_out.len());
    assert_eq!(
        grad_coords.len(),
        coords.len(),
        "coordinate gradient length"
    );
    let (area, channels) = (shape.out_area, shape.channels);
    let to = crate::send_ptr::SharedMut::new(grad_coords);
    for_chunks(shape, coords, |n, range, us, vs| {
        let image = &image[n * channels * shape.in_area()..];
        for (i, (u, v)) in us.iter().zip(vs).enumerate() {
            let s = shape.sample(*u, *v);
            let (mut gu, mut gv) = (T::zero(), T::zero());
            for c in 0..channels {
                let g = grad_out[(n * channels + c) * area + range.start + i];
                let plane = &image[c * shape.in_area() + s.top_left..];
                let (a, b) = (plane[0], plane[s.right]);
                let (c0, d) = (plane[s.down], plane[s.down + s.right]);
                let (top, bottom) = (b - a, d - c0);
                gu = gu + g * (top + (bottom - top) * s.y);
                let (left, right) = (c0 - a, d - b);
                gv = gv + g * (left + (right - left) * s.x);
            }
            let keep = |free: bool, g: T| if free { g } else { T::zero() };
            // SAFETY: pixel ranges of different tasks do not overlap.
            unsafe {
                *to.at(2 * n * area + range.start + i) = keep(s.free_x, gu);
                *to.at((2 * n + 1) * area + range.start + i) = keep(s.free_y, gv);
            }
        }
    });
}

/// Gradient of [`warp`] with respect to the image.
///
/// # Shapes
/// As [`warp`]; `grad_out` N×C×H'×W', `grad_image` N×C×H×W, overwritten.
///
/// # Panics
/// When a length does not fit.
pub fn warp_backward_image<T: Float + Send + Sync>(
    shape: &WarpShape,
    coords: &[T],
    grad_out: &[T],
    grad_image: &mut [T],
) {
    shape.check(grad_image.len(), coords.len(), grad_out.len());
    let (area, channels) = (shape.out_area, shape.channels);
    // Pixels may scatter anywhere: a task owns whole planes.
    grad_image
        .par_chunks_mut(shape.in_area())
        .enumerate()
        .for_each(|(plane_index, plane)| {
            plane.fill(T::zero());
            let n = plane_index / channels;
            let us = &coords[2 * n * area..][..area];
            let vs = &coords[(2 * n + 1) * area..][..area];
            let grads = &grad_out[plane_index * area..][..area];
            for ((u, v), g) in us.iter().zip(vs).zip(grads) {
                let s = shape.sample(*u, *v);
                let (left, right) = (T::one() - s.x, s.x);
                let (top, bottom) = (*g * (T::one() - s.y), *g * s.y);
                let mut add = |at: usize, value: T| plane[at] = plane[at] + value;
                add(s.top_left, top * left);
                add(s.top_left + s.right, top * right);
                add(s.top_left + s.down, bottom * left);
                add(s.top_left + s.down + s.right, bottom * right);
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    const SHAPE: WarpShape = WarpShape {
        channels: 2,
        in_height: 5,
        in_width: 6,
        out_area: 12,
    };

    /// Coordinates inside and outside the image, none within 1e-4 of a pixel centre, where the
    /// bilinear surface has its kinks.
    fn coords() -> Vec<f64> {
        noise(2 * 2 * 12, 9)
            .iter()
            .map(|r| r * 8.0 - 1.5)
            .map(|c| {
                if (c - c.round()).abs() < 1e-4 {
                    c + 0.01
                } else {
                    c
                }
            })
            .collect()
    }

    #[test]
    fn integer_coordinates_copy_the_pixel_and_the_border_extends() {
        let image = noise(60, 1);
        let mut coords = vec![0.0; 24];
        let points = [(0.0, 0.0), (5.0, 4.0), (3.0, 2.0), (-4.0, 1.0), (9.0, 99.0)];
        for (i, (u, v)) in points.iter().enumerate() {
            coords[i] = *u;
            coords[12 + i] = *v;
        }
        let mut out = vec![0.0; 24];
        warp(&SHAPE, &image, &coords, &mut out);
        for c in 0..2 {
            let pixel = |x: usize, y: usize| image[c * 30 + y * 6 + x];
            let expected = [
                pixel(0, 0),
                pixel(5, 4),
                pixel(3, 2),
                pixel(0, 1),
                pixel(5, 4),
            ];
            assert_eq!(out[c * 12..][..5], expected);
        }
    }

    #[test]
    fn a_nan_coordinate_reads_the_image_and_does_not_spread_its_gradient() {
        let image = noise(60, 1);
        let mut coords = vec![1.5; 24];
        coords[0] = f64::NAN;
        let (mut out, mut gradient) = (vec![0.0; 24], vec![0.0; 24]);
        warp(&SHAPE, &image, &coords, &mut out);
        warp_backward_coords(&SHAPE, &image, &coords, &[1.0; 24], &mut gradient);
        assert!(out.iter().chain(&gradient).all(|v| v.is_finite()));
    }

    #[test]
    fn a_single_row_or_column_can_be_read() {
        let shape = WarpShape {
            channels: 1,
            in_height: 1,
            in_width: 3,
            out_area: 1,
        };
        let mut out = [0.0];
        warp(&shape, &[1.0, 2.0, 4.0], &[1.5, 7.0], &mut out);
        assert_eq!(out, [3.0]);
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let (image, coords) = (noise(2 * 60, 2), coords());
        let weights = noise(2 * 24, 3);
        let loss = |image: &[f64], coords: &[f64]| {
            let mut out = vec![0.0; 48];
            warp(&SHAPE, image, coords, &mut out);
            out.iter().zip(&weights).map(|(o, w)| o * w).sum::<f64>()
        };
        let mut by_coords = vec![0.0; coords.len()];
        warp_backward_coords(&SHAPE, &image, &coords, &weights, &mut by_coords);
        for i in 0..coords.len() {
            let mut moved = coords.clone();
            moved[i] += 1e-6;
            let up = loss(&image, &moved);
            moved[i] -= 2e-6;
            let numeric = (up - loss(&image, &moved)) / 2e-6;
            assert!((numeric - by_coords[i]).abs() < 1e-7, "coordinate {i}");
        }
        assert!(
            by_coords.iter().filter(|g| **g == 0.0).count() > 3,
            "border"
        );
        let mut by_image = vec![0.0; image.len()];
        warp_backward_image(&SHAPE, &coords, &weights, &mut by_image);
        for i in 0..image.len() {
            let mut moved = image.clone();
            moved[i] += 0.5;
            let up = loss(&moved, &coords);
            moved[i] -= 1.0;
            let numeric = up - loss(&moved, &coords);
            assert!((numeric - by_image[i]).abs() < 1e-12, "pixel {i}");
        }
    }
}
