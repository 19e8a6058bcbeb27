//! Checks whether the speeds fit the images: km/h mistaken for m/s make every depth 3.6 times too
//! large, and training would not detect it.
//!
//! The road is a plane at the camera's height. Two frames show its motion in units of that height:
//! the homography of the plane n·X = h between them is K (R + t nᵀ / h) K⁻¹, so a known t gives h. A
//! sweep over h finds the plane that best warps the earlier image onto the later one. A car's camera
//! is 0.9 to 2.6 m above the road. A height outside this range means that t, and so the speed, is wrong by the same factor.

use super::snippet::Snippet;
use crate::{Dataset, Result, resize_rgb};
use deepfusion_geometry::Se3;
use deepfusion_hint::count_of;
use deepfusion_motion::{
    GreyImage, GroundPair, RoadTexture, SWEEP_M, SWEEP_RATIO, implied_camera_height,
};
use image::RgbImage;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt;
use std::sync::Arc;

/// Plausible heights of a camera on a road vehicle, in metres.
pub const PLAUSIBLE_HEIGHT_M: std::ops::RangeInclusive<f64> = 0.9..=2.6;
/// Width of the images compared, in pixels, and number of pairs.
const WIDTH: u32 = 240;
const MAX_PAIRS: usize = 24;
/// Camera height of a typical car, for the factor of a wrong unit.
const USUAL_HEIGHT_M: f64 = 1.65;

/// The warning about speeds that contradict the images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedWarning {
    /// Camera height above the road that would explain the images, in metres.
    pub implied_height_m: f64,
    /// Number of pairs of frames compared.
    pub pairs: usize,
}

impl SpeedWarning {
    /// A warning if a camera on a car cannot have this height.
    #[must_use]
    pub fn of_height(implied_height_m: f64, pairs: usize) -> Option<Self> {
        (!PLAUSIBLE_HEIGHT_M.contains(&implied_height_m)).then_some(Self {
            implied_height_m,
            pairs,
        })
    }

    /// The likely unit of the speeds, if one explains the height.
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
                "according to the speeds the vehicle drives, but the road hardly moves in the images ({})",
                count_of(self.pairs, "pair")
            );
        }
        let (low, high) = (PLAUSIBLE_HEIGHT_M.start(), PLAUSIBLE_HEIGHT_M.end());
        write!(
            f,
            "the speeds do not fit the images: according to the road's motion, the camera would be {h:.1} m above it \
             ({}; expected {low} to {high} m), so depths would be about {:.1} times ",
            count_of(self.pairs, "pair"),
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

/// Compares the motion of the road in a sample of the drive's images with its speeds. `None` if they
/// fit, if the images are inconclusive (no texture, no road), or if no yaw rate was recorded.
///
/// # Errors
/// Those of [`Dataset::snippets`] and [`Dataset::load_image`].
pub fn speed_unit_warning(dataset: &Dataset) -> Result<Option<SpeedWarning>> {
    let seen = road_camera_height(dataset)?;
    Ok(seen.and_then(|(height_m, pairs)| SpeedWarning::of_height(height_m, pairs)))
}

/// The camera's height above the road in metres, computed from the road's motion in the images and the drive's speeds, and
/// the number of pairs of frames used; `None` if the images are inconclusive.
///
/// # Errors
/// Those of [`speed_unit_warning`].
pub fn road_camera_height(dataset: &Dataset) -> Result<Option<(f64, usize)>> {
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
        let texture = |image| Arc::new(RoadTexture::from(&grey_image(image, WIDTH, height)));
        Ok(GroundPair {
            earlier: texture(&earlier),
            later: texture(&later),
            intrinsics: k.resized(WIDTH, height),
            // The pairs are independent here, so no acceleration is known.
            seconds: f64::NAN,
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

/// The luma (ITU-R BT.601) of an image resized to `width` × `height`.
#[must_use]
pub fn grey_image(image: &RgbImage, width: u32, height: u32) -> GreyImage {
    let small = resize_rgb(image, width, height);
    let luma = |p: &image::Rgb<u8>| {
        let [r, g, b] = p.0.map(f32::from);
        0.299 * r + 0.587 * g + 0.114 * b
    };
    GreyImage {
        width: width as usize,
        height: height as usize,
        data: small.pixels().map(luma).collect(),
    }
}

/// At most [`MAX_PAIRS`] snippets, spread evenly over the faster half of the drive, in which the road moves most.
fn sample(mut snippets: Vec<Snippet>) -> Vec<Snippet> {
    let distance = |s: &Snippet| s.sources[0].motion.distance_m;
    let mut distances: Vec<f64> = snippets.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    snippets.retain(|s| distance(s) >= median);
    let step = snippets.len().div_ceil(MAX_PAIRS).max(1);
    snippets.into_iter().step_by(step).collect()
}
