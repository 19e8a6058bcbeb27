//! The camera's height above the road, from the road's motion in its images.
//!
//! The road is a plane. Two frames show its motion in units of the camera's height above it: the homography of the plane n·X = h between
//! them is K (R + t nᵀ / h) K⁻¹, so a known t gives h. A sweep over h finds the plane that best maps the earlier image onto the later one.
//! Neither depth nor a network is involved.

use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// Range of heights tried, in metres, and the ratio of one height to the next. Beyond 15 m the road hardly moves.
pub const SWEEP_M: (f64, f64) = (0.3, 15.0);
/// See [`SWEEP_M`].
pub const SWEEP_RATIO: f64 = 1.06;
/// Largest ratio of the best height's cost to the median cost; above it the images are inconclusive. On KITTI
/// it is 0.71 to 0.73 with true speeds, 0.57 to 0.82 with speeds 3.6 times too large or too small; 0.99 on
/// unrelated images.
pub(crate) const CONCLUSIVE: f64 = 0.92;
/// Fewest pairs for a result: a car ahead may fill the view.
const MIN_PAIRS: usize = 4;
/// The road is searched in the middle columns, and in rows whose rays point at least this share as
/// steeply down as the bottom row's.
const COLUMNS: (f64, f64) = (0.2, 0.8);
const STEEPNESS: f64 = 0.35;
/// The distant scene, which translation hardly moves: columns in the middle, and rows around the horizon, given as the slope (down or up)
/// of their rays.
const FAR_COLUMNS: (f64, f64) = (0.3, 0.7);
const FAR_SLOPE: f64 = 0.06;
/// Search range (to both sides) and step of the pitch between two frames, radians: speed and yaw rate do not contain it,
/// and a tenth of a degree moves the road as much as a change of its height.
const PITCH: f64 = 0.0105;
const PITCH_STEP: f64 = 0.0007;
/// One in this many of the road's pixels is used.
const THIN: usize = 2;
/// Half width of the window whose mean is subtracted to remove shade and exposure, in pixels.
const HIGH_PASS: usize = 4;
/// Differences of one pixel are clipped at this, in grey levels of 255: cars and kerbs are not on the plane.
const CLIP: f64 = 20.0;

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

/// A frame's texture, without shade and exposure, from which the road's motion is measured. Computed once, it serves the pair before and
/// the pair after.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadTexture(GreyImage);

impl From<&GreyImage> for RoadTexture {
    fn from(image: &GreyImage) -> Self {
        Self(image.high_pass())
    }
}

/// Two frames of a drive, and the measured motion of the camera between them.
#[derive(Debug, Clone)]
pub struct GroundPair {
    /// The earlier frame.
    pub earlier: Arc<RoadTexture>,
    /// The later frame, of the same size.
    pub later: Arc<RoadTexture>,
    /// Intrinsics of these small images.
    pub intrinsics: Intrinsics,
    /// Time between the frames, in seconds; NaN if unknown.
    pub seconds: f64,
    /// Maps points from the later camera to the earlier one; its translation is tested.
    pub earlier_from_later: Se3,
    /// The direction to the ground in the camera's frame, as a unit vector.
    pub down_in_cam: Vector3<f64>,
}

/// The height above the road, in metres, at which the pairs' motion explains their images best; `None` if no height is clearly better than
/// the others, or fewer than four pairs show the road.
#[must_use]
pub fn implied_camera_height(pairs: &[GroundPair]) -> Option<f64> {
    let costs: Vec<RoadCosts> = pairs.par_iter().filter_map(RoadCosts::of).collect();
    let (pooled, best) = RoadCosts::pooled(&costs.iter().collect::<Vec<_>>())?;
    (pooled[best] <= CONCLUSIVE * median(&pooled)).then(|| height_at(best as f64))
}

/// For each height tried, how well it explains a pair; pairs are pooled by these costs.
#[derive(Debug, Clone, PartialEq)]
pub struct RoadCosts(Vec<f64>);

impl RoadCosts {
    /// `None` if the road is not in view or has no texture.
    #[must_use]
    pub fn of(pair: &GroundPair) -> Option<Self> {
        let count = ((SWEEP_M.1 / SWEEP_M.0).ln() / SWEEP_RATIO.ln()).ceil() as i32;
        let heights: Vec<f64> = (0..=count).map(|i| height_at(f64::from(i))).collect();
        pair.costs(&heights).map(Self)
    }

    /// As [`implied_camera_height`], but interpolated between the heights tried: the minimum of a parabola in the logarithm of the height,
    /// through the best height and its neighbours.
    #[must_use]
    pub fn height(of_pairs: &[&Self]) -> Option<f64> {
        let (pooled, best) = Self::pooled(of_pairs)?;
        if pooled[best] > CONCLUSIVE * median(&pooled) {
            return None;
        }
        let (before, after) = (pooled.get(best.checked_sub(1)?)?, pooled.get(best + 1)?);
        let bend = before - 2.0 * pooled[best] + after;
        let step = 0.5 * (before - after) / bend.max(1e-12);
        Some(height_at(best as f64 + step.clamp(-0.5, 0.5)))
    }

    /// The mean cost at each height, and the index of the smallest; `None` for fewer than four pairs.
    fn pooled(of_pairs: &[&Self]) -> Option<(Vec<f64>, usize)> {
        if of_pairs.len() < MIN_PAIRS {
            return None;
        }
        let mean = |i: usize| of_pairs.iter().map(|c| c.0[i]).sum::<f64>() / of_pairs.len() as f64;
        let pooled: Vec<f64> = (0..of_pairs[0].0.len()).map(mean).collect();
        let best = (0..pooled.len()).min_by(|a, b| pooled[*a].total_cmp(&pooled[*b]))?;
        Some((pooled, best))
    }
}

/// The height with this index among the heights tried, in metres.
fn height_at(number: f64) -> f64 {
    SWEEP_M.0 * SWEEP_RATIO.powf(number)
}

impl GroundPair {
    /// Mean difference of the two images over the road for each height, divided by the median of these; `None` if the road is not in view
    /// or has no texture.
    #[must_use]
    pub fn costs(&self, heights: &[f64]) -> Option<Vec<f64>> {
        self.costs_and_pitch(heights, 0.0).0
    }

    /// As [`Self::costs`], for a camera whose pitch in the earlier frame differs by `tilt` from its mount (radians, nose up). The pitch
    /// from the earlier to the later frame is estimated.
    pub(crate) fn costs_and_pitch(&self, heights: &[f64], tilt: f64) -> (Option<Vec<f64>>, f64) {
        let (earlier, later) = (&self.earlier.0, &self.later.0);
        let pitch = self.pitch(earlier, later);
        let pitched = self.pitched(tilt, pitch);
        (pitched.road_costs(earlier, later, heights), pitch)
    }

    /// Rotation that turns the camera's nose up.
    fn nose_up(&self, angle: f64) -> Se3 {
        let side = self.down_in_cam.cross(&Vector3::z());
        Se3::from_axis_angle(side * angle, Vector3::zeros())
    }

    /// The motion and the direction to the ground of a pitched camera, because the vehicle's sensors do not measure the pitch.
    fn pitched(&self, tilt: f64, pitch: f64) -> Pitched<'_> {
        let motion = &self.earlier_from_later;
        let rotation = self.nose_up(pitch).rotation() * motion.rotation();
        let way = self.nose_up(-tilt).rotate(&motion.translation());
        Pitched {
            intrinsics: &self.intrinsics,
            motion: Se3::from_parts(&rotation, way),
            down: self.nose_up(-tilt - pitch).rotate(&self.down_in_cam),
        }
    }

    /// The pitch between the frames that best maps the distant scene from one image to the other, in radians, nose up.
    fn pitch(&self, earlier: &GreyImage, later: &GreyImage) -> f64 {
        let k_inverse = self.intrinsics.inverse_matrix();
        let (width, height) = (later.width, later.height);
        let columns = [FAR_COLUMNS.0, FAR_COLUMNS.1].map(|share| (width as f64 * share) as usize);
        let far: Vec<(usize, usize)> = (0..height)
            .flat_map(|y| (columns[0]..columns[1]).map(move |x| (x, y)))
            .filter(|(x, y)| {
                let ray = k_inverse * Vector3::new(*x as f64, *y as f64, 1.0);
                self.down_in_cam.dot(&ray).abs() < FAR_SLOPE
            })
            .collect();
        if far.is_empty() {
            return 0.0;
        }
        let steps = (2.0 * PITCH / PITCH_STEP).round() as usize;
        let angle = |step: f64| step * PITCH_STEP - PITCH;
        let cost = |step: usize| {
            let rotation = self.nose_up(angle(step as f64)).rotation();
            let infinity = self.intrinsics.matrix()
                * rotation
                * self.earlier_from_later.rotation()
                * k_inverse;
            difference(earlier, later, &infinity, &far)
        };
        let costs: Vec<f64> = (0..=steps).map(cost).collect();
        least(&costs).map_or(0.0, angle)
    }
}

/// A camera's motion, and the direction to the ground in its frame.
struct Pitched<'a> {
    intrinsics: &'a Intrinsics,
    motion: Se3,
    down: Vector3<f64>,
}

impl Pitched<'_> {
    /// See [`GroundPair::costs`].
    fn road_costs(
        &self,
        earlier: &GreyImage,
        later: &GreyImage,
        heights: &[f64],
    ) -> Option<Vec<f64>> {
        let k_inverse = self.intrinsics.inverse_matrix();
        let (width, height) = (later.width, later.height);
        let steepness = |x: usize, y: usize| {
            let ray = k_inverse * Vector3::new(x as f64, y as f64, 1.0);
            self.down.dot(&ray)
        };
        let bottom = steepness(width / 2, height.checked_sub(1)?);
        if bottom < 0.05 {
            return None;
        }
        let columns = (width as f64 * COLUMNS.0) as usize..(width as f64 * COLUMNS.1) as usize;
        let road: Vec<(usize, usize)> = (0..height)
            .flat_map(|y| columns.clone().map(move |x| (x, y)))
            .filter(|(x, y)| (x + y) % THIN == 0)
            .filter(|(x, y)| steepness(*x, *y) >= STEEPNESS * bottom)
            .collect();
        let cost = |h: &f64| {
            let earlier_from_later = self.homography(*h, &k_inverse);
            difference(earlier, later, &earlier_from_later, &road)
        };
        let mut costs: Vec<f64> = heights.iter().map(cost).collect();
        let scale = median(&costs);
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        costs.iter_mut().for_each(|c| *c /= scale);
        Some(costs)
    }

    /// Maps pixels of the later image to pixels of the earlier one, for points on the plane at height `h`.
    fn homography(&self, h: f64, k_inverse: &Matrix3<f64>) -> Matrix3<f64> {
        let plane = self.motion.rotation() + self.motion.translation() * self.down.transpose() / h;
        self.intrinsics.matrix() * plane * k_inverse
    }
}

/// Mean difference between the later image's pixels and the earlier image at the positions given by a homography.
fn difference(
    earlier: &GreyImage,
    later: &GreyImage,
    earlier_from_later: &Matrix3<f64>,
    pixels: &[(usize, usize)],
) -> f64 {
    // Images are not accurate to a hundredth of a pixel, so single precision is enough.
    let h = earlier_from_later.map(|v| v as f32);
    let clip = CLIP as f32;
    let width = earlier.width;
    if width < 2 || earlier.height < 2 {
        return f64::NAN;
    }
    let most = [width, earlier.height].map(|size| size as f32 - 1.0);
    let last = [width - 2, earlier.height - 2];
    // As `sample`, but with one bounds check for the four pixels: most of the time is spent here.
    let one = |&(x, y): &(usize, usize)| {
        let (u, v) = (x as f32, y as f32);
        let row = |i: usize| h[(i, 0)] * u + h[(i, 1)] * v + h[(i, 2)];
        let inverse = 1.0 / row(2);
        let to = [row(0) * inverse, row(1) * inverse];
        let [x0, y0] = [0, 1].map(|i| (to[i].max(0.0).min(most[i]) as usize).min(last[i]));
        let [fx, fy] = [(0, x0), (1, y0)].map(|(i, low)| to[i].max(0.0).min(most[i]) - low as f32);
        let four = &earlier.data[y0 * width + x0..][..width + 2];
        let top = four[0] + (four[1] - four[0]) * fx;
        let bottom = four[width] + (four[width + 1] - four[width]) * fx;
        let seen = top + (bottom - top) * fy;
        (seen - later.data[y * later.width + x]).abs().min(clip)
    };
    pixels.iter().map(one).sum::<f32>() as f64 / pixels.len() as f64
}

/// Index of the smallest cost, interpolated by a parabola; `None` if it is the first or the last.
pub(crate) fn least(costs: &[f64]) -> Option<f64> {
    let least = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    if least == 0 || least + 1 == costs.len() {
        return None;
    }
    let (a, b, c) = (costs[least - 1], costs[least], costs[least + 1]);
    let bend = a - 2.0 * b + c;
    let shift = if bend > 0.0 {
        0.5 * (a - c) / bend
    } else {
        0.0
    };
    Some(least as f64 + shift.clamp(-0.5, 0.5))
}

impl GreyImage {
    /// The image minus its mean over a square window around each pixel.
    fn high_pass(&self) -> Self {
        let stride = self.width + 1;
        // Sums over all pixels above and to the left: a window's sum follows from four of them.
        let mut sums = vec![0.0f64; stride * (self.height + 1)];
        for (y, row) in self.data.chunks_exact(self.width.max(1)).enumerate() {
            let mut so_far = 0.0;
            for (x, value) in row.iter().enumerate() {
                so_far += f64::from(*value);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + so_far;
            }
        }
        let window =
            |at: usize, size: usize| (at.saturating_sub(HIGH_PASS), (at + HIGH_PASS + 1).min(size));
        let mut data = self.data.clone();
        for y in 0..self.height {
            let (top, bottom) = window(y, self.height);
            let (above, below) = (&sums[top * stride..], &sums[bottom * stride..]);
            for x in 0..self.width {
                let (left, right) = window(x, self.width);
                let sum = below[right] - below[left] - above[right] + above[left];
                let count = (bottom - top) * (right - left);
                data[y * self.width + x] -= (sum / count as f64) as f32;
            }
        }
        Self { data, ..*self }
    }

    /// Bilinear value at a position, clamped to the image.
    #[must_use]
    pub fn sample(&self, x: f32, y: f32) -> f32 {
        let at = |v: f32, size: usize| {
            // NaN becomes 0 here.
            let v = v.max(0.0).min(size as f32 - 1.0);
            let low = (v as usize).min(size.saturating_sub(2));
            (low, (low + 1).min(size - 1), v - low as f32)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_local_mean_is_subtracted() {
        let (width, height) = (23, 11);
        let data: Vec<f32> = (0..width * height)
            .map(|i| (i * 7919 % 256) as f32)
            .collect();
        let image = GreyImage {
            width,
            height,
            data,
        };
        let passed = image.high_pass();
        let reach = HIGH_PASS as isize;
        for (i, value) in passed.data.iter().enumerate() {
            let (x, y) = ((i % width) as isize, (i / width) as isize);
            let window: Vec<f32> = (y - reach..=y + reach)
                .flat_map(|v| (x - reach..=x + reach).map(move |u| (u, v)))
                .filter(|(u, v)| {
                    (0..width as isize).contains(u) && (0..height as isize).contains(v)
                })
                .map(|(u, v)| image.data[v as usize * width + u as usize])
                .collect();
            let mean = window.iter().sum::<f32>() / window.len() as f32;
            assert!((value - (image.data[i] - mean)).abs() < 1e-3, "{x}, {y}");
        }
    }
}
