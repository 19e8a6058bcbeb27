use deepfusion_geometry::DepthMap;
use deepfusion_perception::{Detection, Target};
use image::{Rgb, RgbImage};

use super::colour_of;
use crate::ColourMap;
use crate::depth_picture::{from_pixels, percentile};

/// Disparity in grey with each target's pixels in its colour, the brighter the nearer (the paper's target-segmentation
/// disparity). `detections` are those of the depth image that the targets come from.
#[must_use]
pub fn target_segments(depth: &DepthMap, targets: &[Target], detections: &[Detection]) -> RgbImage {
    let disparity: Vec<f32> = depth
        .data
        .iter()
        .map(|z| if *z > 0.0 { 1.0 / z } else { 0.0 })
        .collect();
    let high = percentile(&disparity, 0.95).max(f32::MIN_POSITIVE);
    let grey = |d: f32| {
        let Rgb([r, g, b]) = ColourMap::Magma.colour(d / high);
        let grey = (u32::from(r) + u32::from(g) + u32::from(b)) / 4;
        Rgb([grey as u8; 3])
    };
    let mut picture = from_pixels(depth.width, &disparity, |d| grey(*d));
    for target in targets {
        let Some(detection) = target.detection.and_then(|i| detections.get(i)) else {
            continue;
        };
        let Rgb(colour) = colour_of(target.id);
        for run in &detection.runs {
            for u in run.from..run.to {
                let d = disparity[run.v as usize * depth.width + u as usize];
                let bright = 0.45 + 0.55 * (d / high).clamp(0.0, 1.0);
                if let Some(pixel) = picture.get_pixel_mut_checked(u, run.v) {
                    *pixel = Rgb(colour.map(|c| (f32::from(c) * bright) as u8));
                }
            }
        }
    }
    picture
}
