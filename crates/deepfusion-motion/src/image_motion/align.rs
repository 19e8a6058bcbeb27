//! Fitting shift and growth to a pair of pictures.

use nalgebra::{SMatrix, SVector};

/// Rows that are aligned, as shares of the height: above the road's surface, below the sky's top.
const ROWS: (f64, f64) = (0.08, 0.60);
/// The coarsest picture is at least this wide and high, in pixels.
const COARSEST: (usize, usize) = (32, 12);
const ITERATIONS: usize = 12;
/// A difference larger than so many times the usual one counts less: cars, things that appear.
const HUBER: f64 = 1.5;
/// Mean squared horizontal slope below which a picture has nothing to hold on to, in squared grey
/// levels of 255 per pixel: a wall's noise is below it.
const LEAST_SLOPE: f64 = 0.5;

/// A picture of numbers.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

/// How one picture lies in the next.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Warp {
    pub right: f64,
    down: f64,
    pub growth: f64,
    brightness: f64,
}

impl Plane {
    pub fn new(width: usize, height: usize, values: &[f32]) -> Self {
        Self {
            width,
            height,
            values: values.iter().map(|v| f64::from(*v)).collect(),
        }
    }

    /// The picture at half the size, each pixel the mean of four; `None` where that is too small.
    pub fn half(&self) -> Option<Self> {
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

    /// Whether its aligned rows are (nearly) all alike, or no numbers.
    fn is_plain(&self) -> bool {
        let rows = &self.values[aligned_rows(self.height).start * self.width
            ..aligned_rows(self.height).end * self.width];
        let slopes: f64 = rows.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
        !(slopes / rows.len() as f64 >= LEAST_SLOPE)
    }

    /// Value and slopes (right, down) at a place, bilinear; `None` outside.
    fn sample(&self, x: f64, y: f64) -> Option<(f64, f64, f64)> {
        // Also false for what is no number.
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

/// The point that growth leaves in place: the middle of the picture.
pub(super) fn centre(width: usize, height: usize) -> (f64, f64) {
    (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0))
}

/// Aligns two pyramids, coarse to fine.
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
            // Twice the pixels: twice the shift.
            warp.right *= 2.0;
            warp.down *= 2.0;
        }
    }
    let limit = 0.25 * before.first()?.width as f64;
    (warp.right.abs() < limit && warp.growth.abs() < 0.5).then_some(warp)
}

/// Gauss–Newton on one level.
fn refine(before: &Plane, after: &Plane, mut warp: Warp) -> Option<Warp> {
    let mut scale = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let Step { step, usual } = step(before, after, &warp, scale)?;
        scale = usual;
        warp.right += step[0];
        warp.down += step[1];
        warp.growth += step[2];
        warp.brightness += step[3];
        if step[0].abs() < 1e-4 && step[1].abs() < 1e-4 && step[2].abs() < 1e-6 {
            break;
        }
    }
    Some(warp)
}

struct Step {
    step: SVector<f64, 4>,
    /// Mean absolute difference.
    usual: f64,
}

fn step(before: &Plane, after: &Plane, warp: &Warp, scale: f64) -> Option<Step> {
    let (cx, cy) = centre(before.width, before.height);
    let rows = aligned_rows(before.height);
    let (mut normal, mut gradient) = (SMatrix::<f64, 4, 4>::zeros(), SVector::<f64, 4>::zeros());
    let (mut count, mut differences) = (0.0, 0.0);
    for y in rows {
        for x in 0..before.width {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            let to_x = x as f64 + warp.right + warp.growth * dx;
            let to_y = y as f64 + warp.down + warp.growth * dy;
            let Some((value, right, down)) = after.sample(to_x, to_y) else {
                continue;
            };
            let difference = before.values[y * before.width + x] + warp.brightness - value;
            let jacobian = SVector::<f64, 4>::new(right, down, right * dx + down * dy, -1.0);
            let ratio = difference.abs() / (HUBER * scale);
            let weight = if ratio > 1.0 { 1.0 / ratio } else { 1.0 };
            normal += jacobian * jacobian.transpose() * weight;
            gradient += jacobian * (difference * weight);
            count += 1.0;
            differences += difference.abs();
        }
    }
    let pixels = (before.width * before.height) as f64;
    if count < 0.2 * pixels {
        return None;
    }
    let step = normal.cholesky()?.solve(&gradient);
    step.iter().all(|s| s.is_finite()).then(|| Step {
        step,
        usual: (differences / count).max(1e-3),
    })
}
