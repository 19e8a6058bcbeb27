//! Projects the pixels of one view into another, from disparity (the paper's Eq. 3–5).
//!
//! p' ~ H·p̃ + d·s with d = 1/D, H = K·R·K⁻¹ and s = K·t. The camera's matrices are multiplied once per image, and disparity, which the
//! network predicts, is never inverted.

use crate::{
    lanes::{sum, sum_product},
    send_ptr::SharedMut,
};
use num_traits::Float;
use rayon::prelude::*;

/// Points closer to the camera's plane than this, in metres, have no projection.
pub const MIN_DEPTH_M: f64 = 1e-3;
/// The coordinate of pixels without a projection, outside of every image.
pub const NOWHERE: f64 = -1e6;
/// Number of rows per task.
const ROWS: usize = 16;

/// The motion of one image's pixels: H (row-major) and s.
struct Motion<T> {
    h: [T; 9],
    s: [T; 3],
}

impl<T: Float> Motion<T> {
    fn new(homography: &[T], shift: &[T], n: usize) -> Self {
        Self {
            h: std::array::from_fn(|i| homography[9 * n + i]),
            s: std::array::from_fn(|i| shift[3 * n + i]),
        }
    }

    /// Row i of H·p̃ at x = 0, and its change per pixel.
    fn row(&self, i: usize, y: T) -> (T, T) {
        (self.h[3 * i + 1] * y + self.h[3 * i + 2], self.h[3 * i])
    }
}

fn number<T: Float>(v: f64) -> T {
    T::from(v).unwrap_or_else(T::zero)
}

fn check(batch: usize, area: usize, homography: usize, shift: usize, coords: usize) {
    assert!(area > 0, "images have pixels");
    assert_eq!(homography, 9 * batch, "one matrix per image");
    assert_eq!(shift, 3 * batch, "one vector per image");
    assert_eq!(coords, 2 * batch * area, "two coordinates per pixel");
}

/// coords(p) = the pixel of the other view. Points behind it, or closer than a millimetre, get coordinates far outside of every image.
///
/// # Shapes
/// `disparity` N×H×W (1/m), `homography` N×3×3, `shift` N×3 (pixels × m), `coords` N×2×H×W.
///
/// # Panics
/// If a length does not match.
pub fn project<T: Float + Send + Sync>(
    (height, width): (usize, usize),
    disparity: &[T],
    homography: &[T],
    shift: &[T],
    coords: &mut [T],
) {
    let area = height * width;
    let batch = disparity.len() / area.max(1);
    check(batch, area, homography.len(), shift.len(), coords.len());
    let to = SharedMut::new(coords);
    let (least, nowhere) = (number::<T>(MIN_DEPTH_M), number::<T>(NOWHERE));
    (0..batch * height)
        .into_par_iter()
        .with_min_len(ROWS)
        .for_each(|row| {
            let (n, y) = (row / height, row % height);
            let motion = Motion::new(homography, shift, n);
            let at_y = number::<T>(y as f64);
            let [(x0, dx), (y0, dy), (w0, dw)] = [0, 1, 2].map(|i| motion.row(i, at_y));
            let [sx, sy, sw] = motion.s;
            let depths = &disparity[row * width..][..width];
            // SAFETY: each row of an image belongs to one task.
            let us = unsafe { to.slice(2 * n * area + y * width, width) };
            // SAFETY: as above, in the other plane.
            let vs = unsafe { to.slice((2 * n + 1) * area + y * width, width) };
            let mut at = T::zero();
            for ((u, v), d) in us.iter_mut().zip(vs).zip(depths) {
                let w = w0 + dw * at + sw * *d;
                let front = w > least * *d;
                let inverse = T::one() / w;
                *u = if front {
                    (x0 + dx * at + sx * *d) * inverse
                } else {
                    nowhere
                };
                *v = if front {
                    (y0 + dy * at + sy * *d) * inverse
                } else {
                    nowhere
                };
                at = at + T::one();
            }
        });
}

/// Gradients of [`project`].
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectGradients<T> {
    /// ∂L/∂H, N×3×3.
    pub homography: Vec<T>,
    /// ∂L/∂s, N×3.
    pub shift: Vec<T>,
}

/// Gradients of [`project`]. The gradient of the disparity is written to `grad_depth`, which is overwritten.
///
/// # Shapes
/// As for [`project`]; `coords` is its output, `grad_coords` N×2×H×W, `grad_depth` N×H×W.
///
/// # Panics
/// If a length does not match.
pub fn project_backward<T: Float + Send + Sync>(
    (height, width): (usize, usize),
    disparity: &[T],
    homography: &[T],
    shift: &[T],
    grad_coords: &[T],
    grad_depth: &mut [T],
) -> ProjectGradients<T> {
    let area = height * width;
    let batch = disparity.len() / area.max(1);
    check(
        batch,
        area,
        homography.len(),
        shift.len(),
        grad_coords.len(),
    );
    assert_eq!(grad_depth.len(), disparity.len(), "depth gradient length");
    let columns: Vec<T> = (0..width).map(|x| number(x as f64)).collect();
    let least = number::<T>(MIN_DEPTH_M);
    // A row's gradients of H and s.
    let rows: Vec<[T; 12]> = grad_depth
        .par_chunks_mut(width)
        .with_min_len(ROWS)
        .enumerate()
        .map_init(
            || vec![T::zero(); 3 * width],
            |buffer, (row, grad_depth)| {
                let (n, y) = (row / height, row % height);
                let motion = Motion::new(homography, shift, n);
                let at_y = number::<T>(y as f64);
                let [(x0, dx), (y0, dy), (w0, dw)] = [0, 1, 2].map(|i| motion.row(i, at_y));
                let [sx, sy, sw] = motion.s;
                let depths = &disparity[row * width..][..width];
                let us = &grad_coords[2 * n * area + y * width..][..width];
                let vs = &grad_coords[(2 * n + 1) * area + y * width..][..width];
                let (gx, rest) = buffer.split_at_mut(width);
                let (gy, gw) = rest.split_at_mut(width);
                for i in 0..width {
                    let (at, d) = (columns[i], depths[i]);
                    let w = w0 + dw * at + sw * d;
                    let inverse = if w > least * d {
                        T::one() / w
                    } else {
                        T::zero()
                    };
                    let u = (x0 + dx * at + sx * d) * inverse;
                    let v = (y0 + dy * at + sy * d) * inverse;
                    gx[i] = us[i] * inverse;
                    gy[i] = vs[i] * inverse;
                    gw[i] = -(us[i] * u + vs[i] * v) * inverse;
                    grad_depth[i] = gx[i] * sx + gy[i] * sy + gw[i] * sw;
                }
                let mut sums = [T::zero(); 12];
                for (i, g) in [&*gx, &*gy, &*gw].into_iter().enumerate() {
                    let all = sum(g);
                    sums[3 * i] = sum_product(g, &columns);
                    sums[3 * i + 1] = all * at_y;
                    sums[3 * i + 2] = all;
                    sums[9 + i] = sum_product(g, depths);
                }
                sums
            },
        )
        .collect();
    let mut gradients = ProjectGradients {
        homography: Vec::with_capacity(9 * batch),
        shift: Vec::with_capacity(3 * batch),
    };
    for rows in rows.chunks_exact(height) {
        let total: [T; 12] =
            std::array::from_fn(|i| rows.iter().fold(T::zero(), |sum, row| sum + row[i]));
        gradients.homography.extend_from_slice(&total[..9]);
        gradients.shift.extend_from_slice(&total[9..]);
    }
    gradients
}

/// 1 where a coordinate is inside an image of `height` × `width`, 0 elsewhere.
///
/// # Shapes
/// `coords` N×2×`area`, `out` N×`area`.
///
/// # Panics
/// If a length does not match.
pub fn in_view((height, width): (usize, usize), coords: &[f32], area: usize, out: &mut [f32]) {
    assert_eq!(coords.len(), 2 * out.len(), "two coordinates per pixel");
    let last = |size: usize| number::<f32>((size - 1) as f64);
    let (right, bottom) = (last(width), last(height));
    out.par_chunks_mut(area)
        .zip(coords.par_chunks(2 * area))
        .for_each(|(out, coords)| {
            let (us, vs) = coords.split_at(area);
            for ((out, u), v) in out.iter_mut().zip(us).zip(vs) {
                let inside = *u >= 0.0 && *u <= right && *v >= 0.0 && *v <= bottom;
                *out = f32::from(u8::from(inside));
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    const SIZE: (usize, usize) = (5, 20);
    const AREA: usize = 100;

    /// A camera that turns slightly and moves forward; the second image has points behind the camera.
    fn inputs() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let depths = noise(2 * AREA, 5).iter().map(|d| 0.05 + 0.3 * d).collect();
        let homography = vec![
            1.01, 0.02, 0.5, -0.01, 0.98, 0.3, 0.002, -0.001, 1.0, //
            0.99, -0.03, 0.1, 0.02, 1.02, -0.4, -0.001, 0.003, 1.0,
        ];
        (depths, homography, vec![3.0, -1.0, -0.8, -2.0, 1.5, -4.0])
    }

    fn coords(depths: &[f64], homography: &[f64], shift: &[f64]) -> Vec<f64> {
        let mut coords = vec![f64::NAN; 4 * AREA];
        project(SIZE, depths, homography, shift, &mut coords);
        coords
    }

    #[test]
    fn equals_the_projection_of_points() {
        let (depths, h, s) = inputs();
        let coords = coords(&depths, &h, &s);
        let (mut seen, mut behind) = (0, 0);
        for n in 0..2 {
            for i in 0..AREA {
                let p = [(i % 20) as f64, (i / 20) as f64, 1.0];
                let depth = 1.0 / depths[n * AREA + i];
                let point: [f64; 3] = std::array::from_fn(|r| {
                    let row = &h[9 * n + 3 * r..][..3];
                    depth * (0..3).map(|c| row[c] * p[c]).sum::<f64>() + s[3 * n + r]
                });
                let (u, v) = (coords[2 * n * AREA + i], coords[(2 * n + 1) * AREA + i]);
                if point[2] > MIN_DEPTH_M {
                    seen += 1;
                    assert!((u - point[0] / point[2]).abs() < 1e-9 * (1.0 + u.abs()));
                    assert!((v - point[1] / point[2]).abs() < 1e-9 * (1.0 + v.abs()));
                } else {
                    behind += 1;
                    assert_eq!((u, v), (NOWHERE, NOWHERE));
                }
            }
        }
        assert!(seen > 100 && behind > 5, "{seen} {behind}");
    }

    /// Checks by central differences that `gradient` is the gradient of `loss` at `point`.
    fn check_gradient(
        what: &str,
        point: &[f64],
        gradient: &[f64],
        step: f64,
        loss: &dyn Fn(&[f64]) -> f64,
    ) {
        assert_eq!(point.len(), gradient.len(), "{what}");
        for (i, ours) in gradient.iter().enumerate() {
            let at = |step: f64| {
                let mut moved = point.to_vec();
                moved[i] += step;
                loss(&moved)
            };
            let numeric = (at(step) - at(-step)) / (2.0 * step);
            let close = (numeric - ours).abs() < 1e-5 * (1.0 + ours.abs());
            assert!(close, "{what}[{i}]: {ours} instead of {numeric}");
        }
    }

    /// Central differences in f64. Points with a small w, where the function is steep, are left out.
    #[test]
    fn gradients_equal_finite_differences() {
        let (mut depths, h, s) = inputs();
        for d in &mut depths[AREA..] {
            *d *= 0.5;
        }
        let weights = noise(4 * AREA, 8);
        let loss = |d: &[f64], h: &[f64], s: &[f64]| -> f64 {
            let coords = coords(d, h, s);
            coords.iter().zip(&weights).map(|(c, w)| c * w).sum()
        };
        let mut grad_depth = vec![f64::NAN; 2 * AREA];
        let grads = project_backward(SIZE, &depths, &h, &s, &weights, &mut grad_depth);
        check_gradient("disparity", &depths, &grad_depth, 1e-6, &|d| {
            loss(d, &h, &s)
        });
        check_gradient("homography", &h, &grads.homography, 1e-7, &|h| {
            loss(&depths, h, &s)
        });
        check_gradient("shift", &s, &grads.shift, 1e-6, &|s| loss(&depths, &h, s));
    }

    #[test]
    fn the_border_is_in_view() {
        let coords = [0.0, 19.0, 19.1, -0.1, 3.0, 0.0, 4.0, 2.0, 2.0, f32::NAN];
        let mut view = [7.0; 5];
        in_view(SIZE, &coords, 5, &mut view);
        assert_eq!(view, [1.0, 1.0, 0.0, 0.0, 0.0]);
    }
}
