//! Fits shift and growth to a pair of images.

mod blocks;

use nalgebra::{SMatrix, SVector};

/// Rows that are aligned, as shares of the height: above the road's surface, below the sky's top.
const ROWS: (f64, f64) = (0.08, 0.60);
/// The coarsest image is at least this wide and high, in pixels.
const COARSEST: (usize, usize) = (32, 12);
const ITERATIONS: usize = 12;
/// Huber's constant: a difference larger than this many times the median has less weight (cars, things that appear).
const HUBER: f64 = 1.5;
/// Smallest mean squared horizontal gradient of an image that can be aligned, in squared grey levels of 255 per pixel: the noise of a blank
/// wall is below it.
const LEAST_SLOPE: f64 = 0.5;

/// A single-channel image.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

/// The warp from one image to the next.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Warp {
    pub right: f64,
    pub down: f64,
    /// Rotation about the centre, clockwise, in radians.
    pub clockwise: f64,
    pub growth: f64,
    brightness: f64,
}

impl Plane {
    pub(super) fn new(width: usize, height: usize, values: &[f32]) -> Self {
        Self {
            width,
            height,
            values: values.iter().map(|v| f64::from(*v)).collect(),
        }
    }

    /// The image at half the size, each pixel the mean of four; `None` if that is too small.
    pub(super) fn half(&self) -> Option<Self> {
        let (width, height) = (self.width / 2, self.height / 2);
        if width < COARSEST.0 || height < COARSEST.1 {
            return None;
        }
        let at = |x: usize, y: usize| self.values[y * self.width + x];
        let mean = |x: usize, y: usize| {
            let (x, y) = (2 * x, 2 * y);
            0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Some(Self {
            width,
            height,
            values: pixels.map(|(x, y)| mean(x, y)).collect(),
        })
    }

    /// Whether the aligned rows have (nearly) no texture, or contain NaN.
    fn is_plain(&self) -> bool {
        let rows = &self.values[aligned_rows(self.height).start * self.width
            ..aligned_rows(self.height).end * self.width];
        let slopes: f64 = rows.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
        let has_structure = slopes / rows.len() as f64 >= LEAST_SLOPE;
        !has_structure
    }

    /// Value and gradient (right, down) at a position, bilinear; `None` outside.
    fn sample(&self, x: f64, y: f64) -> Option<(f64, f64, f64)> {
        // Also false for NaN.
        let inside =
            x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64;
        if !inside {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f64, y - row as f64);
        let first = row * self.width + column;
        let [a, b] = [self.values[first], self.values[first + 1]];
        let [c, d] = [
            self.values[first + self.width],
            self.values[first + self.width + 1],
        ];
        let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
        let right = (b - a) * (1.0 - fy) + (d - c) * fy;
        Some((top + (bottom - top) * fy, right, bottom - top))
    }
}

fn aligned_rows(height: usize) -> std::ops::Range<usize> {
    (height as f64 * ROWS.0) as usize..(height as f64 * ROWS.1) as usize
}

/// The centre of growth: the middle of the image.
pub(super) fn centre(width: usize, height: usize) -> (f64, f64) {
    (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0))
}

/// Aligns two image pyramids, coarse to fine.
pub(super) fn align(before: &[Plane], after: &[Plane]) -> Option<Warp> {
    let plain = |pyramid: &[Plane]| pyramid.first().is_none_or(Plane::is_plain);
    if before.len() != after.len() || plain(before) || plain(after) {
        return None;
    }
    let mut warp = Warp::default();
    for (level, (a, b)) in before.iter().zip(after).enumerate().rev() {
        if (a.width, a.height) != (b.width, b.height) {
            return None;
        }
        warp = refine(a, b, warp)?;
        if level > 0 {
            // At twice the size, shifts are twice as large.
            warp.right *= 2.0;
            warp.down *= 2.0;
        }
    }
    let warp = blocks::refine(before.first()?, after.first()?, warp)?;
    let limit = 0.25 * before.first()?.width as f64;
    (warp.right.abs() < limit && warp.growth.abs() < 0.5).then_some(warp)
}

/// One pixel's residual, I₀ + β − I₁, and the gradient of I₁ (right, down).
struct Reading {
    difference: f64,
    right: f64,
    down: f64,
}

impl Reading {
    /// The residual at a pixel of `before`, given its distance from the centre, with a growth of its own.
    fn at(
        before: &Plane,
        after: &Plane,
        warp: &Warp,
        (x, y): (usize, usize),
        (dx, dy): (f64, f64),
        growth: f64,
    ) -> Option<Self> {
        let to_x = x as f64 + warp.right + growth * dx - warp.clockwise * dy;
        let to_y = y as f64 + warp.down + growth * dy + warp.clockwise * dx;
        let (value, right, down) = after.sample(to_x, to_y)?;
        Some(Self {
            difference: before.values[y * before.width + x] + warp.brightness - value,
            right,
            down,
        })
    }

    /// Huber's weight.
    fn weight(&self, scale: f64) -> f64 {
        let ratio = self.difference.abs() / (HUBER * scale);
        if ratio > 1.0 { 1.0 / ratio } else { 1.0 }
    }
}

/// Gauss–Newton iterations on one level, with one growth for the whole image.
fn refine(before: &Plane, after: &Plane, mut warp: Warp) -> Option<Warp> {
    let mut scale = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let (step, usual) = step(before, after, &warp, scale)?;
        scale = usual;
        warp.right += step[0];
        warp.down += step[1];
        warp.growth += step[2];
        warp.clockwise += step[3];
        warp.brightness += step[4];
        if step[0].abs() < 1e-3 && step[1].abs() < 1e-3 && step[2].abs() < 1e-5 {
            break;
        }
    }
    Some(warp)
}

/// One step, and the mean absolute difference before it.
fn step(before: &Plane, after: &Plane, warp: &Warp, scale: f64) -> Option<(SVector<f64, 5>, f64)> {
    let (cx, cy) = centre(before.width, before.height);
    let (mut normal, mut gradient) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
    let (mut count, mut differences) = (0.0, 0.0);
    for y in aligned_rows(before.height) {
        for x in 0..before.width {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            let Some(reading) = Reading::at(before, after, warp, (x, y), (dx, dy), warp.growth)
            else {
                continue;
            };
            let Reading { right, down, .. } = reading;
            let outward = right * dx + down * dy;
            let around = down * dx - right * dy;
            let jacobian = SVector::<f64, 5>::new(right, down, outward, around, -1.0);
            let weight = reading.weight(scale);
            normal += jacobian * jacobian.transpose() * weight;
            gradient += jacobian * (reading.difference * weight);
            count += 1.0;
            differences += reading.difference.abs();
        }
    }
    if count < 0.2 * (before.width * before.height) as f64 {
        return None;
    }
    let step = normal.cholesky()?.solve(&gradient);
    let finite = step.iter().all(|s| s.is_finite());
    finite.then(|| (step, (differences / count).max(1e-3)))
}
