//! The camera's rotation and direction of motion between two images, from the depth of one of them.

use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{SMatrix, SVector, Vector3};

use super::{DepthImage, GreyPyramid};
use crate::GreyImage;

/// Largest number of steps at each size.
const STEPS: usize = 12;
/// A smaller step (in radians, and in units of the typical depth) ends the iteration at a size.
const SMALL: f64 = 1e-5;
/// Pixels with a smaller gradient than this, in grey levels per pixel, are not used.
const GRADIENT: f32 = 2.0;
/// Largest number of pixels at each size; if there are more, they are thinned.
const PIXELS: usize = 12_000;
/// Fewest pixels for a result.
const LEAST: usize = 400;
/// Degrees of freedom of the t distribution that weights the residuals (Kerl, Sturm and Cremers, ICRA 2013).
const FREEDOM: f64 = 5.0;
/// Number of unknowns: translation (3), rotation (3), gain and offset of brightness.
const N: usize = 8;

/// The camera's motion, in the units of the depth it was found with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// Maps a point from the camera of the image with depth to the other image's camera; the translation is in the units of the depth.
    pub source_from_target: Se3,
    /// Square root of the weighted mean squared residual, in grey levels of 255.
    pub residual: f64,
    /// Share of the image's textured pixels that are visible in the other image.
    pub seen: f64,
}

/// Finds the camera's motion, starting from `guess`: the image `target` is warped by its depth into the image `source` so that brightness
/// agrees, coarse to fine (direct alignment by Gauss-Newton steps with robust weights, together with a gain and an offset of brightness).
/// `None` if the images have too little texture, or no step improves the agreement.
///
/// # Panics
/// If `depth` or `source` differ in size from `target`.
#[must_use]
pub fn align(
    target: &GreyPyramid,
    depth: &DepthImage<'_>,
    source: &GreyPyramid,
    guess: &Se3,
) -> Option<Alignment> {
    let full = target.full();
    assert_eq!(
        (depth.width, depth.height),
        (full.width, full.height),
        "the depth has the target's size"
    );
    assert_eq!(
        (source.full().width, source.full().height),
        (full.width, full.height),
        "both images have the same size"
    );
    // Translation in units of a typical depth has about the same magnitude as rotation in radians.
    let unit = typical(depth.data)?;
    let mut state = State {
        motion: scaled(guess, 1.0 / unit),
        gain: 1.0,
        offset: 0.0,
    };
    let mut last = None;
    for (level, (target, source)) in target
        .levels()
        .iter()
        .zip(source.levels())
        .enumerate()
        .rev()
    {
        let points = textured(target, depth, level, unit);
        if points.len() < LEAST / (1 << level) {
            continue;
        }
        let camera = depth
            .intrinsics
            .resized(target.width as u32, target.height as u32);
        last = Some(state.settle(&points, source, &camera)?);
    }
    let (residual, seen) = last?;
    Some(Alignment {
        source_from_target: scaled(&state.motion, unit),
        residual,
        seen,
    })
}

/// A pixel with texture: its point in the target's camera, in units of the typical depth, and its grey level.
struct Point {
    at: Vector3<f64>,
    grey: f64,
}

struct State {
    motion: Se3,
    gain: f64,
    offset: f64,
}

impl State {
    /// Iterates until the steps are small; returns the residual and the share of visible points.
    fn settle(
        &mut self,
        points: &[Point],
        source: &GreyImage,
        camera: &Intrinsics,
    ) -> Option<(f64, f64)> {
        let mut damping = 1e-4;
        let mut now = self.equations(points, source, camera)?;
        for _ in 0..STEPS {
            let step = now.step(damping)?;
            let next_state = self.moved(&step);
            let next = next_state.equations(points, source, camera);
            match next {
                Some(next) if next.cost <= now.cost => {
                    let small = step.rows(0, 6).amax() < SMALL;
                    (*self, now) = (next_state, next);
                    damping = (damping * 0.3).max(1e-7);
                    if small {
                        break;
                    }
                }
                _ => {
                    damping *= 10.0;
                    if damping > 1e3 {
                        break;
                    }
                }
            }
        }
        Some((now.cost.sqrt(), now.seen as f64 / points.len() as f64))
    }

    fn moved(&self, step: &SVector<f64, N>) -> Self {
        let way = step.fixed_rows::<3>(0).into_owned();
        let turn = step.fixed_rows::<3>(3).into_owned();
        let update = Se3::from_axis_angle(turn, way);
        Self {
            motion: update * self.motion,
            gain: self.gain + step[6],
            offset: self.offset + step[7],
        }
    }

    /// The normal equations at the points' current positions; `None` if too few points are visible.
    fn equations(
        &self,
        points: &[Point],
        source: &GreyImage,
        camera: &Intrinsics,
    ) -> Option<Equations> {
        let mut rows = Vec::with_capacity(points.len());
        for point in points {
            let at = self.motion.transform(&point.at);
            if at.z < 0.02 {
                continue;
            }
            let (u, v) = (
                camera.fx * at.x / at.z + camera.cx,
                camera.fy * at.y / at.z + camera.cy,
            );
            let Some((grey, du, dv)) = sample(source, u, v) else {
                continue;
            };
            let residual = self.gain * grey + self.offset - point.grey;
            // ∂(u, v)/∂X, times the image's gradient.
            let (gu, gv) = (
                self.gain * du * camera.fx / at.z,
                self.gain * dv * camera.fy / at.z,
            );
            let towards = Vector3::new(gu, gv, -(gu * at.x + gv * at.y) / at.z);
            // ∂X/∂rotation = −[X]×, so that its row is X × ∂I/∂X.
            let turning = at.cross(&towards);
            rows.push((towards, turning, grey, residual));
        }
        if rows.len() < LEAST / 8 || rows.len() * 4 < points.len() {
            return None;
        }
        let spread = spread(rows.iter().map(|r| r.3));
        let mut normal = SMatrix::<f64, N, N>::zeros();
        let mut right = SVector::<f64, N>::zeros();
        let (mut cost, mut total) = (0.0, 0.0);
        for (way, turn, grey, residual) in &rows {
            let weight = (FREEDOM + 1.0) / (FREEDOM + (residual / spread).powi(2));
            let row =
                SVector::<f64, N>::from([way.x, way.y, way.z, turn.x, turn.y, turn.z, *grey, 1.0]);
            normal.ger(weight, &row, &row, 1.0);
            right.axpy(weight * residual, &row, 1.0);
            cost += weight * residual * residual;
            total += weight;
        }
        Some(Equations {
            normal,
            right,
            cost: cost / total,
            seen: rows.len(),
        })
    }
}

struct Equations {
    normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    cost: f64,
    seen: usize,
}

impl Equations {
    fn step(&self, damping: f64) -> Option<SVector<f64, N>> {
        let mut normal = self.normal;
        for i in 0..N {
            normal[(i, i)] *= 1.0 + damping;
        }
        Some(-normal.cholesky()?.solve(&self.right))
    }
}

/// 1.4826 × the median of the absolute values, which estimates the standard deviation of normal ones; at least one grey level.
fn spread(residuals: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = residuals.map(f64::abs).collect();
    if sizes.is_empty() {
        return 1.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(1.0)
}

/// The median of the valid depths (finite and above 0).
fn typical(depth: &[f32]) -> Option<f64> {
    let mut known: Vec<f32> = depth.iter().copied().filter(|d| usable(*d)).collect();
    if known.is_empty() {
        return None;
    }
    let middle = known.len() / 2;
    let (_, median, _) = known.select_nth_unstable_by(middle, f32::total_cmp);
    Some(f64::from(*median))
}

fn usable(depth: f32) -> bool {
    depth.is_finite() && depth > 0.0
}

fn scaled(motion: &Se3, factor: f64) -> Se3 {
    Se3::from_parts(&motion.rotation(), motion.translation() * factor)
}

/// The textured pixels at one size, evenly thinned to at most [`PIXELS`].
fn textured(image: &GreyImage, depth: &DepthImage<'_>, level: usize, unit: f64) -> Vec<Point> {
    let camera = depth
        .intrinsics
        .resized(image.width as u32, image.height as u32);
    let at = |x: usize, y: usize| image.data[y * image.width + x];
    let mut found = Vec::new();
    for y in 1..image.height.saturating_sub(1) {
        for x in 1..image.width.saturating_sub(1) {
            let (gx, gy) = (
                0.5 * (at(x + 1, y) - at(x - 1, y)),
                0.5 * (at(x, y + 1) - at(x, y - 1)),
            );
            if gx * gx + gy * gy < GRADIENT * GRADIENT {
                continue;
            }
            // The depth at the centre of the pixel at this size.
            let middle = |i: usize| (i << level) + (1 << level) / 2;
            let z = depth.data[middle(y) * depth.width + middle(x)];
            if usable(z) {
                let z = f64::from(z) / unit;
                found.push(Point {
                    at: camera.back_project(x as f64, y as f64, z),
                    grey: f64::from(at(x, y)),
                });
            }
        }
    }
    let every = found.len().div_ceil(PIXELS).max(1);
    found.into_iter().step_by(every).collect()
}

/// The bilinear value at a position and its derivatives; `None` outside the image.
fn sample(image: &GreyImage, u: f64, v: f64) -> Option<(f64, f64, f64)> {
    let inside =
        u >= 0.0 && v >= 0.0 && u < (image.width - 1) as f64 && v < (image.height - 1) as f64;
    if !inside {
        return None;
    }
    let (x, y) = (u as usize, v as usize);
    let (fx, fy) = (u - x as f64, v - y as f64);
    let four = &image.data[y * image.width + x..];
    let [a, b] = [0, 1].map(|i| f64::from(four[i]));
    let [c, d] = [0, 1].map(|i| f64::from(four[image.width + i]));
    let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
    let across = (b - a) + ((d - c) - (b - a)) * fy;
    Some((top + (bottom - top) * fy, across, bottom - top))
}
