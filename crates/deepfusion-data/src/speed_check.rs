//! Whether the speeds fit what the images show: km/h taken for m/s makes every depth 3.6 times too
//! large, and nothing in training would notice.
//!
//! The road is a plane at the camera's height. Two frames show its motion in units of that height:
//! the homography of the plane n·X = h between them is K (R + t nᵀ / h) K⁻¹, so a known t gives h. A
//! sweep over h finds the plane that best carries the earlier image onto the later one. A car's camera
//! is 0.9 to 2.6 m above the road; a height outside says that t, and so the speed, is wrong by as much.

use crate::snippet::Snippet;
use crate::{Dataset, Result, resize_rgb};
use deepfusion_geometry::{Intrinsics, Se3};
use image::RgbImage;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::fmt;

/// Heights that a camera on a road vehicle can have, in metres.
pub(crate) const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 0.9..=2.6;
/// Heights tried, in metres, and the ratio of one to the next. Beyond 15 m the road hardly moves.
const SWEEP_M: (f64, f64) = (0.3, 15.0);
const SWEEP_RATIO: f64 = 1.06;
/// The best height's cost over the median's, above which the images say nothing. On KITTI it is 0.71 to
/// 0.73 with true speeds, 0.57 to 0.82 with speeds 3.6 times too large or too small; 0.99 on unrelated images.
const CONCLUSIVE: f64 = 0.92;
/// Width of the images compared, in pixels, and how many pairs.
const WIDTH: u32 = 240;
const MAX_PAIRS: usize = 24;
/// Fewer pairs than this prove nothing: a car ahead may fill the view.
const MIN_PAIRS: usize = 4;
/// The road is looked for in the middle columns, and in rows whose rays point at least this share as
/// steeply down as the bottom row's.
const COLUMNS: (f64, f64) = (0.2, 0.8);
const STEEPNESS: f64 = 0.35;
/// Half the window whose mean is taken off, so that shade and exposure do not count, in pixels.
const HIGH_PASS: usize = 4;
/// Largest difference of one pixel that counts, in grey levels of 255: cars and kerbs are not the plane.
const CLIP: f64 = 20.0;
/// Camera height of a usual car, to name the factor of a wrong unit.
const USUAL_HEIGHT_M: f64 = 1.65;

/// Speeds that the images contradict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedWarning {
    /// How high above the road the camera would have to be, in metres.
    pub implied_height_m: f64,
    /// How many pairs of frames were compared.
    pub pairs: usize,
}

/// A small grey image, values 0 to 255, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyImage {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// `width * height` values.
    pub data: Vec<f32>,
}

/// Two frames of a drive, and how the camera is said to have moved between them.
#[derive(Debug, Clone)]
pub struct GroundPair {
    /// The frame before.
    pub earlier: GreyImage,
    /// The frame after.
    pub later: GreyImage,
    /// Of these small images.
    pub intrinsics: Intrinsics,
    /// A point of the later camera in the earlier one; its translation is what is tested.
    pub earlier_from_later: Se3,
    /// The direction to the ground in the camera's frame, of length 1.
    pub down_in_cam: Vector3<f64>,
}

impl SpeedWarning {
    /// A warning if a camera that high cannot be on a car.
    #[must_use]
    pub fn of_height(implied_height_m: f64, pairs: usize) -> Option<Self> {
        (!PLAUSIBLE_M.contains(&implied_height_m)).then_some(Self {
            implied_height_m,
            pairs,
        })
    }

    /// The unit the speeds seem to be in, if one explains the height.
    #[must_use]
    pub fn likely_unit(&self) -> Option<&'static str> {
        let factor = self.implied_height_m / USUAL_HEIGHT_M;
        let units = [("km/h", 3.6), ("mph", 2.237), ("knots", 1.944)];
        let distance = |f: f64| (factor / f).ln().abs();
        let nearest = units
            .iter()
            .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
        (distance(nearest.1) < 0.2).then_some(nearest.0)
    }
}

impl fmt::Display for SpeedWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let h = self.implied_height_m;
        if h > SWEEP_M.1 / SWEEP_RATIO.powi(2) {
            return write!(
                f,
                "the speeds say the car drives, but the road hardly moves in the images ({} pairs)",
                self.pairs
            );
        }
        let (low, high) = (PLAUSIBLE_M.start(), PLAUSIBLE_M.end());
        write!(
            f,
            "the speeds do not fit the images: the road's motion would put the camera {h:.1} m above it \
             ({} pairs; cars have it at {low} to {high} m), so depths would come out about {:.1} times ",
            self.pairs,
            if h > *high {
                h / USUAL_HEIGHT_M
            } else {
                USUAL_HEIGHT_M / h
            },
        )?;
        write!(f, "too {}", if h > *high { "large" } else { "small" })?;
        match self.likely_unit() {
            Some(unit) => write!(f, "; are the speeds in {unit}, not m/s?"),
            None => Ok(()),
        }
    }
}

/// Compares the motion of the road in a sample of the drive's images with its speeds. `None` where
/// they fit, where the images do not tell (no texture, no road), and where no yaw rate was recorded.
///
/// # Errors
/// As [`Dataset::snippets`] and [`Dataset::load_image`].
pub fn speed_unit_warning(dataset: &Dataset) -> Result<Option<SpeedWarning>> {
    let seen = road_camera_height(dataset)?;
    Ok(seen.and_then(|(height_m, pairs)| SpeedWarning::of_height(height_m, pairs)))
}

/// How high above the road the camera is by the motion of the road in the images and the drive's speeds, in metres, and
/// by how many pairs of frames; `None` where the images do not tell.
///
/// # Errors
/// As [`speed_unit_warning`].
pub(crate) fn road_camera_height(dataset: &Dataset) -> Result<Option<(f64, usize)>> {
    let snippets = sample(dataset.snippets(&[-1], 0.5)?);
    let Some(cam_from_vehicle) = dataset.cam_from_vehicle() else {
        return Ok(None);
    };
    let down_in_cam = -cam_from_vehicle.rotate(&Vector3::z());
    let load = |(snippet, earlier_from_later): (&Snippet, Se3)| -> Result<GroundPair> {
        let later = dataset.load_image(snippet.target)?;
        let k = dataset.intrinsics(snippet.target);
        let height = (k.height * WIDTH).div_ceil(k.width).max(1);
        let source = &snippet.sources[0];
        let earlier = dataset.load_image(source.frame)?;
        Ok(GroundPair {
            earlier: GreyImage::from_rgb(&earlier, WIDTH, height),
            later: GreyImage::from_rgb(&later, WIDTH, height),
            intrinsics: k.resized(WIDTH, height),
            earlier_from_later,
            down_in_cam,
        })
    };
    let known = |s: &'_ Snippet| s.sources[0].motion.source_from_target;
    let turned = snippets.iter().filter_map(|s| Some((s, known(s)?)));
    let turned: Vec<_> = turned.collect();
    let pairs = turned
        .into_par_iter()
        .map(load)
        .collect::<Result<Vec<_>>>()?;
    Ok(implied_camera_height(&pairs).map(|height_m| (height_m, pairs.len())))
}

/// At most [`MAX_PAIRS`] snippets, evenly over the faster half of the drive, where the road moves most.
fn sample(mut snippets: Vec<Snippet>) -> Vec<Snippet> {
    let distance = |s: &Snippet| s.sources[0].motion.distance_m;
    let mut distances: Vec<f64> = snippets.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    snippets.retain(|s| distance(s) >= median);
    let step = snippets.len().div_ceil(MAX_PAIRS).max(1);
    snippets.into_iter().step_by(step).collect()
}

/// The height above the road, in metres, at which the pairs' motion explains their images best; `None`
/// where no height does clearly better than others, or there are fewer than four pairs that show road.
#[must_use]
pub fn implied_camera_height(pairs: &[GroundPair]) -> Option<f64> {
    let count = ((SWEEP_M.1 / SWEEP_M.0).ln() / SWEEP_RATIO.ln()).ceil() as i32;
    let heights: Vec<f64> = (0..=count)
        .map(|i| SWEEP_M.0 * SWEEP_RATIO.powi(i))
        .collect();
    let costs: Vec<Vec<f64>> = pairs
        .par_iter()
        .filter_map(|pair| pair.costs(&heights))
        .collect();
    if costs.len() < MIN_PAIRS {
        return None;
    }
    let pooled: Vec<f64> = (0..heights.len())
        .map(|i| costs.iter().map(|c| c[i]).sum::<f64>() / costs.len() as f64)
        .collect();
    let best = (0..pooled.len()).min_by(|a, b| pooled[*a].total_cmp(&pooled[*b]))?;
    (pooled[best] <= CONCLUSIVE * median(&pooled)).then(|| heights[best])
}

impl GroundPair {
    /// Mean difference of the two images over the road for each height, over the median of them; `None`
    /// where the road is not in view or has no texture.
    fn costs(&self, heights: &[f64]) -> Option<Vec<f64>> {
        let (earlier, later) = (self.earlier.high_pass(), self.later.high_pass());
        let k_inverse = self.intrinsics.inverse_matrix();
        let (width, height) = (later.width, later.height);
        let steepness = |x: usize, y: usize| {
            let ray = k_inverse * Vector3::new(x as f64, y as f64, 1.0);
            self.down_in_cam.dot(&ray)
        };
        let bottom = steepness(width / 2, height.checked_sub(1)?);
        if bottom < 0.05 {
            return None;
        }
        let columns = (width as f64 * COLUMNS.0) as usize..(width as f64 * COLUMNS.1) as usize;
        let road: Vec<(usize, usize)> = (0..height)
            .flat_map(|y| columns.clone().map(move |x| (x, y)))
            .filter(|(x, y)| steepness(*x, *y) >= STEEPNESS * bottom)
            .collect();
        let cost = |h: &f64| {
            let earlier_from_later = self.homography(*h, &k_inverse);
            let difference = |(x, y): &(usize, usize)| {
                let q = earlier_from_later * Vector3::new(*x as f64, *y as f64, 1.0);
                let seen = earlier.sample(q.x / q.z, q.y / q.z);
                f64::from((seen - later.data[y * width + x]).abs()).min(CLIP)
            };
            road.iter().map(difference).sum::<f64>() / road.len() as f64
        };
        let mut costs: Vec<f64> = heights.iter().map(cost).collect();
        let scale = median(&costs);
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        costs.iter_mut().for_each(|c| *c /= scale);
        Some(costs)
    }

    /// Pixels of the later image to pixels of the earlier, for points on the plane at height `h`.
    fn homography(&self, h: f64, k_inverse: &Matrix3<f64>) -> Matrix3<f64> {
        let motion = &self.earlier_from_later;
        let plane = motion.rotation() + motion.translation() * self.down_in_cam.transpose() / h;
        self.intrinsics.matrix() * plane * k_inverse
    }
}

impl GreyImage {
    /// The luma (ITU-R BT.601) of an image resized to `width` × `height`.
    #[must_use]
    pub fn from_rgb(image: &RgbImage, width: u32, height: u32) -> Self {
        let small = resize_rgb(image, width, height);
        let luma = |p: &image::Rgb<u8>| {
            let [r, g, b] = p.0.map(f32::from);
            0.299 * r + 0.587 * g + 0.114 * b
        };
        Self {
            width: width as usize,
            height: height as usize,
            data: small.pixels().map(luma).collect(),
        }
    }

    /// The image less its mean over a square window about each pixel.
    fn high_pass(&self) -> Self {
        let mut data = self.data.clone();
        for y in 0..self.height {
            let rows = y.saturating_sub(HIGH_PASS)..(y + HIGH_PASS + 1).min(self.height);
            for x in 0..self.width {
                let columns = x.saturating_sub(HIGH_PASS)..(x + HIGH_PASS + 1).min(self.width);
                let mut sum = 0.0;
                for row in rows.clone() {
                    let start = row * self.width;
                    let window = &self.data[start + columns.start..start + columns.end];
                    sum += window.iter().sum::<f32>();
                }
                data[y * self.width + x] -= sum / (rows.len() * columns.len()) as f32;
            }
        }
        Self { data, ..*self }
    }

    /// Bilinear value at a position, which is moved into the image first.
    pub(crate) fn sample(&self, x: f64, y: f64) -> f32 {
        let at = |v: f64, size: usize| {
            // NaN becomes 0 here.
            let v = v.max(0.0).min(size as f64 - 1.0);
            let low = (v as usize).min(size.saturating_sub(2));
            (low, (low + 1).min(size - 1), (v - low as f64) as f32)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (at(x, self.width), at(y, self.height));
        let value = |x: usize, y: usize| self.data[y * self.width + x];
        let top = value(x0, y0) * (1.0 - fx) + value(x1, y0) * fx;
        let bottom = value(x0, y1) * (1.0 - fx) + value(x1, y1) * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
