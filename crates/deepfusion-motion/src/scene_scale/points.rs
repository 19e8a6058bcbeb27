//! Scale factors for the depth of single patches.

use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::GreyImage;

/// Half the side of a patch, in pixels.
const HALF: usize = 4;
/// Distance between the centres of neighbouring patches, in pixels.
const SPACING: usize = 10;
/// Largest factor searched, as a logarithm: factors from 1/2 to 2.
const SEARCH: f64 = std::f64::consts::LN_2;
/// One step of the search moves a patch by about this many pixels.
const STEP_PX: f64 = 0.6;
/// Smallest motion of a patch, in pixels per change of its depth by a factor e.
const LEAST_PX: f64 = 4.0;
/// Largest translation towards a patch, as a share of its depth: beyond, it looks too different.
const LARGEST_WAY: f64 = 0.35;
/// Smallest standard deviation of a patch's grey levels.
const TEXTURE: f32 = 4.0;
/// Smallest correlation at which a patch counts as found.
const FOUND: f32 = 0.85;
/// A second match whose correlation is within this of the best one makes it ambiguous, if it is farther away than [`NEAR`].
const MARGIN: f32 = 0.05;
/// See [`MARGIN`]; as a logarithm of the factor.
const NEAR: f64 = 0.18;

/// Depth of every pixel of an image.
#[derive(Debug, Clone, Copy)]
pub struct DepthImage<'a> {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// `width * height` depths (camera z, metres), row by row; values that are not above 0 are ignored.
    pub data: &'a [f32],
    /// The camera at this size.
    pub intrinsics: Intrinsics,
}

/// Another image of the scene, and where it was taken.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The image, of the same size as the image with depth.
    pub image: &'a GreyImage,
    /// Maps a point from the camera of the image with depth to this image's camera; the translation is in metres as *measured*.
    pub source_from_target: Se3,
}

/// The scale factor found for a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneFactor {
    /// Column and row of the patch's centre.
    pub at: [usize; 2],
    /// The given depth there, in metres.
    pub depth_m: f32,
    /// ln s\*: the logarithm of the factor that the depth should be multiplied by.
    pub log_factor: f64,
    /// Motion of the patch in pixels per factor e on its depth: the larger, the more accurate.
    pub pixels: f64,
}

/// The factors of all patches of `target` that are found in one of the `views`. Used is the view in which the patch moves most, among those
/// whose camera did not come too close to it.
///
/// # Panics
/// If the images differ in size.
#[must_use]
pub fn scene_points(
    target: &GreyImage,
    depth: &DepthImage<'_>,
    views: &[View<'_>],
) -> Vec<SceneFactor> {
    let size = (depth.width, depth.height);
    assert_eq!(size, (target.width, target.height), "one size");
    for view in views {
        assert_eq!(size, (view.image.width, view.image.height), "one size");
    }
    let rows: Vec<usize> = centres(depth.height);
    let columns = centres(depth.width);
    let of_row = |y: &usize| {
        let mut scratch = Vec::new();
        let patches = columns.iter().filter_map(|&x| {
            let patch = Patch::of(target, depth, [x, *y], &mut scratch)?;
            patch.factor(views)
        });
        patches.collect::<Vec<_>>()
    };
    rows.par_iter().flat_map_iter(of_row).collect()
}

fn centres(size: usize) -> Vec<usize> {
    (HALF + 1..size.saturating_sub(HALF + 1))
        .step_by(SPACING)
        .collect()
}

/// A pixel of a patch: its ray times its depth, and its grey level minus the patch's mean.
type Pixel = (Vector3<f64>, f32);

struct Patch {
    at: [usize; 2],
    depth_m: f32,
    /// Position of the centre in the camera frame.
    centre: Vector3<f64>,
    pixels: Vec<Pixel>,
    /// Square root of the sum of squares of the grey levels.
    norm: f32,
    camera: Intrinsics,
}

impl Patch {
    /// `None` for a patch without texture or depth.
    fn of(
        image: &GreyImage,
        depth: &DepthImage<'_>,
        [x, y]: [usize; 2],
        greys: &mut Vec<f32>,
    ) -> Option<Self> {
        let usable = |d: f32| (d.is_finite() && d > 0.0).then_some(d);
        greys.clear();
        for row in y - HALF..=y + HALF {
            greys.extend_from_slice(&image.data[row * image.width + x - HALF..][..2 * HALF + 1]);
        }
        let mean = greys.iter().sum::<f32>() / greys.len() as f32;
        let square: f32 = greys.iter().map(|g| (g - mean).powi(2)).sum();
        if square < TEXTURE * TEXTURE * greys.len() as f32 {
            return None;
        }
        let depth_m = usable(depth.data[y * depth.width + x])?;
        let camera = depth.intrinsics;
        let point = |column: usize, row: usize| {
            let z = usable(depth.data[row * depth.width + column]).unwrap_or(depth_m);
            camera.back_project(column as f64, row as f64, f64::from(z))
        };
        let mut pixels = Vec::with_capacity(greys.len());
        for (i, grey) in greys.iter().enumerate() {
            let (column, row) = (x - HALF + i % (2 * HALF + 1), y - HALF + i / (2 * HALF + 1));
            pixels.push((point(column, row), grey - mean));
        }
        Some(Self {
            at: [x, y],
            depth_m,
            centre: point(x, y),
            pixels,
            norm: square.sqrt(),
            camera,
        })
    }

    fn factor(&self, views: &[View<'_>]) -> Option<SceneFactor> {
        let mut best: Option<(f64, &View<'_>)> = None;
        for view in views {
            let way = view.source_from_target.translation().norm();
            if way > LARGEST_WAY * f64::from(self.depth_m) {
                continue;
            }
            let pixels = self.movement(view);
            if best.is_none_or(|(most, _)| pixels > most) {
                best = Some((pixels, view));
            }
        }
        let (pixels, view) = best.filter(|(pixels, _)| *pixels >= LEAST_PX)?;
        let log_factor = self.search(view, pixels)?;
        Some(SceneFactor {
            at: self.at,
            depth_m: self.depth_m,
            log_factor,
            pixels,
        })
    }

    /// Where the patch's centre appears if its depth is multiplied by a factor.
    fn seen(&self, view: &View<'_>, factor: f64) -> Option<[f64; 2]> {
        let at = view.source_from_target.transform(&(self.centre * factor));
        let pixel = self.camera.project(&at)?;
        Some([pixel.x, pixel.y])
    }

    /// Motion in pixels per factor e, from a small change.
    fn movement(&self, view: &View<'_>) -> f64 {
        const SMALL: f64 = 0.02;
        let [a, b] = [-SMALL, SMALL].map(|log| self.seen(view, log.exp()));
        let (Some([ua, va]), Some([ub, vb])) = (a, b) else {
            return 0.0;
        };
        (ub - ua).hypot(vb - va) / (2.0 * SMALL)
    }

    /// The logarithm of the factor at which the patch matches; `None` without a single clear match.
    fn search(&self, view: &View<'_>, pixels: f64) -> Option<f64> {
        let steps = ((2.0 * SEARCH * pixels / STEP_PX).ceil() as usize).clamp(16, 96);
        let log = |i: f64| -SEARCH + 2.0 * SEARCH * i / steps as f64;
        let correlations: Vec<f32> = (0..=steps)
            .map(|i| self.correlation(view, log(i as f64).exp()))
            .collect();
        let best = (0..=steps).max_by(|a, b| correlations[*a].total_cmp(&correlations[*b]))?;
        if best == 0 || best == steps || correlations[best] < FOUND {
            return None;
        }
        let rival = (0..=steps).any(|i| {
            (log(i as f64) - log(best as f64)).abs() > NEAR
                && correlations[i] > correlations[best] - MARGIN
        });
        if rival {
            return None;
        }
        let [a, b, c] = [best - 1, best, best + 1].map(|i| f64::from(correlations[i]));
        let bend = a - 2.0 * b + c;
        let shift = if bend < 0.0 {
            0.5 * (a - c) / bend
        } else {
            0.0
        };
        Some(log(best as f64 + shift.clamp(-0.5, 0.5)))
    }

    /// Zero-mean normalised cross-correlation of the patch with its warped position; −1 if that is outside the image.
    fn correlation(&self, view: &View<'_>, factor: f64) -> f32 {
        let (image, motion) = (view.image, &view.source_from_target);
        // The scaled point s·X is at s·R·X + t.
        let (rotation, way) = (motion.rotation() * factor, motion.translation());
        let (mut sum, mut square, mut product) = (0.0f32, 0.0f32, 0.0f32);
        for (point, grey) in &self.pixels {
            let at = rotation * point + way;
            if at.z <= 1e-3 {
                return -1.0;
            }
            let u = (self.camera.fx * at.x / at.z + self.camera.cx) as f32;
            let v = (self.camera.fy * at.y / at.z + self.camera.cy) as f32;
            let inside = u >= 0.0
                && v >= 0.0
                && u <= (image.width - 1) as f32
                && v <= (image.height - 1) as f32;
            if !inside {
                return -1.0;
            }
            let seen = image.sample(u, v);
            sum += seen;
            square += seen * seen;
            product += seen * grey;
        }
        let count = self.pixels.len() as f32;
        let variance = square - sum * sum / count;
        if variance <= 0.25 * TEXTURE * TEXTURE * count {
            return -1.0;
        }
        // The grey levels of the patch have mean 0.
        product / (self.norm * variance.sqrt())
    }
}
