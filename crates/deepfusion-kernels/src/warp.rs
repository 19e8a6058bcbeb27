//! The bilinear warp, which samples an image at given pixel coordinates.
//!
//! Integer coordinates are pixel centres. Outside the image, the nearest border pixel is sampled: the output does not depend on a
//! coordinate that was moved to the border, and its gradient is zero.

use crate::sizes::product;
use num_traits::Float;
use pulp::Arch;
use rayon::prelude::*;

/// The sizes of a warp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WarpShape {
    /// Channels of the image, C.
    pub channels: usize,
    /// Height of the image that is sampled.
    pub in_height: usize,
    /// Width of the image that is sampled.
    pub in_width: usize,
    /// Number of pixels of the output, H'·W'.
    pub out_area: usize,
}

/// Pixels whose coordinates are computed together, in loops of fixed length, which the compiler vectorises.
const LANES: usize = 16;

/// The number type of coordinates and pixels.
///
/// # Safety
/// [`Self::integer_part`] must return the integer part: pixels are then read without a check.
pub unsafe trait WarpFloat: Float + Send + Sync {
    /// The integer part.
    ///
    /// # Safety
    /// The number must be finite and within the range of an `i32`. (The checked conversion is not vectorised.)
    unsafe fn integer_part(self) -> i32;
}

// SAFETY: the conversion truncates the fraction.
unsafe impl WarpFloat for f32 {
    #[inline(always)]
    unsafe fn integer_part(self) -> i32 {
        // SAFETY: guaranteed by the caller.
        unsafe { self.to_int_unchecked() }
    }
}

// SAFETY: as above.
unsafe impl WarpFloat for f64 {
    #[inline(always)]
    unsafe fn integer_part(self) -> i32 {
        // SAFETY: guaranteed by the caller.
        unsafe { self.to_int_unchecked() }
    }
}

/// For each of some coordinates: the upper left of its four neighbours, and its position between them, 0 to 1.
struct Samples<T> {
    top_left: [usize; LANES],
    x: [T; LANES],
    y: [T; LANES],
    /// 1 where moving the coordinate along x (or y) moves the sample, else 0.
    free_x: [T; LANES],
    free_y: [T; LANES],
}

impl WarpShape {
    fn in_area(&self) -> usize {
        product([self.in_height, self.in_width])
    }

    /// Distance from a neighbour to the one to its right, and to the one below.
    fn steps(&self) -> (usize, usize) {
        let down = if self.in_height > 1 { self.in_width } else { 0 };
        (usize::from(self.in_width > 1), down)
    }

    /// Samples of at most [`LANES`] coordinates, padded with zeros.
    #[inline(always)]
    fn samples<T: WarpFloat>(&self, us: &[T], vs: &[T]) -> Samples<T> {
        let (x0, x, free_x) = axis(&padded(us), self.in_width);
        let (y0, y, free_y) = axis(&padded(vs), self.in_height);
        let mut top_left = [0; LANES];
        for l in 0..LANES {
            top_left[l] = (y0[l] * self.in_width as i32 + x0[l]) as usize;
        }
        Samples {
            top_left,
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
        assert!(i32::try_from(self.in_area()).is_ok(), "pixels of a plane");
        // Beyond this, an f32 cannot distinguish the last pixel from the next.
        assert!(
            self.in_width.max(self.in_height) <= 1 << 24,
            "pixels of a side"
        );
        let size = product([self.channels, self.in_area()]);
        assert_eq!(image % size, 0, "whole images");
        let batch = image / size;
        let coordinates = product([batch, 2, self.out_area]);
        assert_eq!(coords, coordinates, "two coordinates per pixel");
        let values = product([batch, self.channels, self.out_area]);
        assert_eq!(out, values, "output length");
    }
}

/// Along one axis: the lower neighbour, the distance of the coordinate from it, and whether the coordinate moves the sample.
#[inline(always)]
fn axis<T: WarpFloat>(p: &[T; LANES], size: usize) -> ([i32; LANES], [T; LANES], [T; LANES]) {
    let last = T::from(size - 1).unwrap_or_else(T::zero);
    let most = (last - T::one()).max(T::zero());
    let mut low = [T::zero(); LANES];
    let (mut index, mut part, mut free) = ([0; LANES], low, low);
    // One short loop for each step: longer ones are not vectorised.
    for l in 0..LANES {
        // A NaN coordinate reads pixel 0, as `max` returns the number.
        part[l] = p[l].max(T::zero()).min(last);
    }
    for l in 0..LANES {
        low[l] = part[l].floor().min(most);
    }
    for l in 0..LANES {
        part[l] = part[l] - low[l];
    }
    for l in 0..LANES {
        // SAFETY: between 0 and the last pixel.
        index[l] = unsafe { low[l].integer_part() };
    }
    for l in 0..LANES {
        let moves = p[l] >= T::zero() && p[l] <= last;
        free[l] = if moves { T::one() } else { T::zero() };
    }
    (index, part, free)
}

/// Number of pixels per task.
const CHUNK: usize = 4096;

/// The four neighbours of each sample in a plane, row by row: upper left and right, lower left and right.
///
/// # Safety
/// The plane must have as many pixels as the shape says.
#[inline(always)]
unsafe fn neighbours<T: WarpFloat>(
    shape: &WarpShape,
    plane: &[T],
    samples: &Samples<T>,
) -> [[T; LANES]; 4] {
    let (right, down) = shape.steps();
    let mut corners = [[T::zero(); LANES]; 4];
    for (corner, step) in corners.iter_mut().zip([0, right, down, down + right]) {
        for l in 0..LANES {
            // SAFETY: `samples` keeps the upper left one in the image, and not in the last row or column unless there is only one.
            corner[l] = unsafe { *plane.get_unchecked(samples.top_left[l] + step) };
        }
    }
    corners
}

/// At most [`LANES`] numbers, padded with zeros. A full set is copied without a loop of variable length.
#[inline(always)]
fn padded<T: WarpFloat>(from: &[T]) -> [T; LANES] {
    match from.first_chunk::<LANES>() {
        Some(whole) => *whole,
        None => std::array::from_fn(|l| from.get(l).copied().unwrap_or_else(T::zero)),
    }
}

/// Writes as many of the numbers as there is room for.
#[inline(always)]
fn write<T: WarpFloat>(values: &[T; LANES], to: &mut [T]) {
    match to.first_chunk_mut::<LANES>() {
        Some(whole) => *whole = *values,
        None => to.copy_from_slice(&values[..to.len()]),
    }
}

/// out(p) = image⟨coords(p)⟩, bilinear.
///
/// # Shapes
/// `image` N×C×H×W, `coords` N×2×H'×W' (u, then v, in pixels), `out` N×C×H'×W'.
///
/// # Panics
/// If a length does not match.
pub fn warp<T: WarpFloat>(shape: &WarpShape, image: &[T], coords: &[T], out: &mut [T]) {
    shape.check(image.len(), coords.len(), out.len());
    let (area, channels) = (shape.out_area, shape.channels);
    let to = crate::send_ptr::SharedMut::new(out);
    for_lanes(
        shape,
        coords,
        #[inline(always)]
        |n, start, count, samples| {
            for c in n * channels..(n + 1) * channels {
                let plane = &image[c * shape.in_area()..][..shape.in_area()];
                // SAFETY: the plane is whole; pixel ranges of different tasks do not overlap.
                let ([a, b, c0, d], row) = unsafe {
                    (
                        neighbours(shape, plane, samples),
                        to.slice(c * area + start, count),
                    )
                };
                let mut values = [T::zero(); LANES];
                for l in 0..LANES {
                    let (x, y) = (samples.x[l], samples.y[l]);
                    let (top, bottom) = (a[l] + (b[l] - a[l]) * x, c0[l] + (d[l] - c0[l]) * x);
                    values[l] = top + (bottom - top) * y;
                }
                write(&values, row);
            }
        },
    );
}

/// Calls `work(image index, first pixel, pixels, their samples)` for all pixels, at most [`LANES`] at once.
fn for_lanes<T: WarpFloat>(
    shape: &WarpShape,
    coords: &[T],
    work: impl Fn(usize, usize, usize, &Samples<T>) + Sync,
) {
    let area = shape.out_area;
    let chunks = area.div_ceil(CHUNK);
    let batch = coords.len() / (2 * area);
    (0..batch * chunks).into_par_iter().for_each(|task| {
        let (n, start) = (task / chunks, task % chunks * CHUNK);
        let range = start..(start + CHUNK).min(area);
        each_lanes(
            shape,
            coords,
            n,
            range,
            #[inline(always)]
            |n, start, count, samples| work(n, start, count, samples),
        );
    });
}

/// Like [`for_lanes`], for a range of pixels of image `n`, with the widest instructions available.
fn each_lanes<T: WarpFloat>(
    shape: &WarpShape,
    coords: &[T],
    n: usize,
    range: std::ops::Range<usize>,
    mut work: impl FnMut(usize, usize, usize, &Samples<T>),
) {
    let area = shape.out_area;
    let us = &coords[2 * n * area..][range.clone()];
    let vs = &coords[(2 * n + 1) * area..][range.clone()];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            let lanes = us.chunks(LANES).zip(vs.chunks(LANES));
            for (start, (us, vs)) in range.step_by(LANES).zip(lanes) {
                work(n, start, us.len(), &shape.samples(us, vs));
            }
        },
    );
}

/// Gradient of [`warp`] with respect to the coordinates.
///
/// # Shapes
/// As for [`warp`]; `grad_out` N×C×H'×W', `grad_coords` N×2×H'×W', overwritten.
///
/// # Panics
/// If a length does not match.
pub fn warp_backward_coords<T: WarpFloat>(
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
    for_lanes(
        shape,
        coords,
        #[inline(always)]
        |n, start, count, samples| {
            let (mut gu, mut gv) = ([T::zero(); LANES], [T::zero(); LANES]);
            for c in n * channels..(n + 1) * channels {
                let grads = padded(&grad_out[c * area + start..][..count]);
                let plane = &image[c * shape.in_area()..][..shape.in_area()];
                // SAFETY: the plane is whole.
                let [a, b, c0, d] = unsafe { neighbours(shape, plane, samples) };
                for l in 0..LANES {
                    let (x, y, g) = (samples.x[l], samples.y[l], grads[l]);
                    let (top, bottom) = (b[l] - a[l], d[l] - c0[l]);
                    gu[l] = gu[l] + g * (top + (bottom - top) * y);
                    let (left, right) = (c0[l] - a[l], d[l] - b[l]);
                    gv[l] = gv[l] + g * (left + (right - left) * x);
                }
            }
            for l in 0..LANES {
                // Not multiplied: a NaN gradient must not spread to coordinates that do not move the sample.
                let keep = |free: T, g: T| if free > T::zero() { g } else { T::zero() };
                gu[l] = keep(samples.free_x[l], gu[l]);
                gv[l] = keep(samples.free_y[l], gv[l]);
            }
            // SAFETY: pixel ranges of different tasks do not overlap.
            unsafe {
                write(&gu, to.slice(2 * n * area + start, count));
                write(&gv, to.slice((2 * n + 1) * area + start, count));
            }
        },
    );
}

/// Gradient of [`warp`] with respect to the image.
///
/// # Shapes
/// As for [`warp`]; `grad_out` N×C×H'×W', `grad_image` N×C×H×W, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn warp_backward_image<T: WarpFloat>(
    shape: &WarpShape,
    coords: &[T],
    grad_out: &[T],
    grad_image: &mut [T],
) {
    shape.check(grad_image.len(), coords.len(), grad_out.len());
    let (area, channels, in_area) = (shape.out_area, shape.channels, shape.in_area());
    let batch = coords.len() / (2 * area);
    // Gradients may be added to any pixel, so a task has whole planes: all of an image, whose samples are then computed once, or, if there
    // are few images, each plane separately.
    let together = if batch >= 2 * rayon::current_num_threads() {
        channels
    } else {
        1
    };
    let (right, down) = shape.steps();
    grad_image
        .par_chunks_mut(together * in_area)
        .enumerate()
        .for_each(|(task, planes)| {
            planes.fill(T::zero());
            let first = task * together;
            each_lanes(
                shape,
                coords,
                first / channels,
                0..area,
                #[inline(always)]
                |_, start, count, samples| {
                    for (c, plane) in planes.chunks_exact_mut(in_area).enumerate() {
                        let grads = &grad_out[(first + c) * area + start..][..count];
                        let mut parts = [[T::zero(); 4]; LANES];
                        for l in 0..count {
                            let (x, y, g) = (samples.x[l], samples.y[l], grads[l]);
                            let (top, bottom) = (g * (T::one() - y), g * y);
                            let left = T::one() - x;
                            parts[l] = [top * left, top * x, bottom * left, bottom * x];
                        }
                        // SAFETY: `samples` keeps all four neighbours in the image.
                        unsafe {
                            scatter(plane, &samples.top_left[..count], &parts, (right, down))
                        };
                    }
                },
            );
        });
}

/// Adds to each sample's four neighbours their shares (upper left and right, lower left and right).
///
/// Neighbouring samples are mostly one pixel apart and share two of the four neighbours. Those sums are kept until the next sample has
/// added to them, instead of being read back from memory just after they were written.
///
/// # Safety
/// All neighbours must be in the plane.
#[inline(always)]
unsafe fn scatter<T: WarpFloat>(
    plane: &mut [T],
    top_left: &[usize],
    parts: &[[T; 4]; LANES],
    (right, down): (usize, usize),
) {
    let mut add = |at: usize, value: T| {
        // SAFETY: guaranteed by the caller.
        let pixel = unsafe { plane.get_unchecked_mut(at) };
        *pixel = *pixel + value;
    };
    let mut at = top_left[0];
    let mut sums = [T::zero(); 4];
    for (next, part) in top_left.iter().zip(parts) {
        if *next != at {
            add(at, sums[0]);
            add(at + down, sums[2]);
            if *next == at + right {
                sums = [sums[1], T::zero(), sums[3], T::zero()];
            } else {
                add(at + right, sums[1]);
                add(at + down + right, sums[3]);
                sums = [T::zero(); 4];
            }
            at = *next;
        }
        for (sum, part) in sums.iter_mut().zip(part) {
            *sum = *sum + *part;
        }
    }
    for (step, sum) in [0, right, down, down + right].into_iter().zip(sums) {
        add(at + step, sum);
    }
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

    /// Coordinates inside and outside the image, none within 1e-4 of a pixel centre, where the bilinear surface has its kinks.
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
