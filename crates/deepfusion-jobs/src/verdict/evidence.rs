//! Evidence from one frame, compared with the frames before it.

use deepfusion_data::{Dataset, RgbImage, grey_image};
use deepfusion_eval::median;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_kernels::{PhotometricShape, photometric_error};
use deepfusion_motion::{Alignment, DepthImage, GreyImage, GreyPyramid, View, align, scene_points};
use deepfusion_runtime::{DepthEstimator, PreparedImage};
use image::imageops::crop_imm;
use nalgebra::Vector3;

use super::Target;
use crate::Result;

/// An alignment whose rotation differs from the measured one by more than this, in radians, has failed: bumps are smaller.
const ASTRAY_TURN: f64 = 0.05;
/// The same limit for the direction of the camera's translation; a camera's mount is often only roughly known.
const ASTRAY_WAY: f64 = 0.45;
/// Smallest share of the textured pixels that must be visible in the frame before.
const SEEN: f64 = 0.4;

/// The evidence from a frame.
#[derive(Default)]
pub(super) struct FrameEvidence {
    /// Scene points: the predicted depth, and the logarithm of the factor that would correct it.
    pub points: Vec<(f64, f64)>,
    /// ln(translation found with the depth / measured translation).
    pub log_way: Option<f64>,
    /// Photometric errors of the frame before: warped, and unwarped.
    pub reprojection: Option<(f64, f64)>,
    /// Median of |ln(warped depth / depth)|.
    pub consistency: Option<f64>,
    /// Median of |ln(depth / depth of the mirrored image)|.
    pub flip: Option<f64>,
}

/// A frame and the network's prediction for it.
struct PredictedFrame {
    prepared: PreparedImage,
    grey: GreyPyramid,
    depth: DepthMap,
    camera: Intrinsics,
    /// The part of the image that the network saw.
    window: [u32; 4],
}

impl PredictedFrame {
    fn size(&self) -> (u32, u32) {
        (self.depth.width as u32, self.depth.height as u32)
    }

    fn depth(&self) -> DepthImage<'_> {
        DepthImage {
            width: self.depth.width,
            height: self.depth.height,
            data: &self.depth.data,
            intrinsics: self.camera,
        }
    }
}

/// Measures a frame; with `closely`, also what needs further runs of the network.
pub(super) fn evidence_of_frame(
    estimator: &mut DepthEstimator,
    dataset: &Dataset,
    target: &Target,
    closely: bool,
    focal_correction: bool,
) -> Result<FrameEvidence> {
    let image = dataset.load_image(target.frame)?;
    let predicted = predict(estimator, dataset, target.frame, &image, focal_correction)?;
    let mut evidence = FrameEvidence::default();
    let mut views: Vec<(GreyPyramid, Se3)> = Vec::new();
    // The ratio of the translation found with the depth to the measured one, starting with the nearest frame.
    let mut factor = 1.0;
    for (place, (frame, measured)) in target.sources.iter().enumerate() {
        let before = dataset.load_image(*frame)?;
        let grey = GreyPyramid::new(grey_like(&before, predicted.window, predicted.size()));
        let found = aligned(&predicted, &grey, measured, factor);
        if place == 0 {
            evidence.reprojection = reprojection(&predicted, grey.full(), measured);
            if closely {
                let motion = found.map_or(*measured, |f| f.source_from_target);
                let other = predict(estimator, dataset, *frame, &before, focal_correction)?;
                evidence.consistency = consistency(&predicted, &other.depth, &motion);
            }
        }
        let Some(found) = found else { continue };
        let (way, measured_way) = (
            found.source_from_target.translation(),
            measured.translation().norm(),
        );
        factor = way.norm() / measured_way;
        // The shortest translation gives the least accurate ratio; a longer one replaces it.
        evidence.log_way = Some(factor.ln());
        let metric = Se3::from_parts(&found.source_from_target.rotation(), way / factor);
        views.push((grey, metric));
    }
    let views: Vec<View<'_>> = views
        .iter()
        .map(|(grey, motion)| View {
            image: grey.full(),
            source_from_target: *motion,
        })
        .collect();
    let points = scene_points(predicted.grey.full(), &predicted.depth(), &views);
    evidence.points = points
        .iter()
        .map(|p| (f64::from(p.depth_m), p.log_factor))
        .collect();
    if closely {
        let camera = dataset.intrinsics(target.frame);
        let other = estimator.infer_mirrored(&predicted.prepared)?;
        evidence.flip = flip(&predicted.depth, &other.network_depth(&camera).0);
    }
    Ok(evidence)
}

fn predict(
    estimator: &mut DepthEstimator,
    dataset: &Dataset,
    frame: usize,
    image: &RgbImage,
    focal_correction: bool,
) -> Result<PredictedFrame> {
    let camera = dataset.intrinsics(frame);
    let preparer = estimator.preparer();
    let prepared = preparer.prepare(image, Some(&camera), focal_correction, false);
    let prediction = estimator.infer(&prepared)?;
    let window = prediction.window;
    let (depth, camera) = prediction.network_depth(&camera);
    let grey = grey_like(image, window, (depth.width as u32, depth.height as u32));
    Ok(PredictedFrame {
        prepared,
        grey: GreyPyramid::new(grey),
        depth,
        camera,
        window,
    })
}

/// Another frame's image, prepared as by [`predict`], but without depth.
fn grey_like(image: &RgbImage, window: [u32; 4], (width, height): (u32, u32)) -> GreyImage {
    let [x, y, w, h] = window;
    if [0, 0, image.width(), image.height()] == window {
        grey_image(image, width, height)
    } else {
        grey_image(&crop_imm(image, x, y, w, h).to_image(), width, height)
    }
}

/// The motion to the frame before, aligned by the depth, starting from the measured motion; `None` if the alignment fails.
fn aligned(
    predicted: &PredictedFrame,
    before: &GreyPyramid,
    measured: &Se3,
    factor: f64,
) -> Option<Alignment> {
    let guess = Se3::from_parts(&measured.rotation(), measured.translation() * factor);
    let found = align(&predicted.grey, &predicted.depth(), before, &guess)?;
    let turned = (found.source_from_target * measured.inverse()).angle();
    let (way, expected) = (
        found.source_from_target.translation(),
        measured.translation(),
    );
    let good = found.seen >= SEEN && turned <= ASTRAY_TURN && way.angle(&expected) <= ASTRAY_WAY;
    good.then_some(found)
}

/// Photometric errors of the frame before, warped by depth and measured motion, and unwarped, over the pixels visible in both.
fn reprojection(
    predicted: &PredictedFrame,
    before: &GreyImage,
    source_from_target: &Se3,
) -> Option<(f64, f64)> {
    let here = predicted.grey.full();
    let (width, height) = (here.width, here.height);
    let share = |v: &f32| v / 255.0;
    let target: Vec<f32> = here.data.iter().map(share).collect();
    let unwarped: Vec<f32> = before.data.iter().map(share).collect();
    let mut warped = vec![0.0; target.len()];
    let mut inside = vec![false; target.len()];
    for i in 0..target.len() {
        let (x, y) = (i % width, i / width);
        if let Some((u, v, _)) = carried(predicted, source_from_target, x, y)
            && u >= 0.0
            && v >= 0.0
            && u <= (width - 1) as f64
            && v <= (height - 1) as f64
        {
            warped[i] = before.sample(u as f32, v as f32) / 255.0;
            inside[i] = true;
        }
    }
    let shape = PhotometricShape {
        channels: 1,
        height,
        width,
        alpha: 0.85,
    };
    let seen_pixels = inside.iter().filter(|i| **i).count();
    if seen_pixels * 4 < target.len() {
        return None;
    }
    let mut error = vec![0.0; target.len()];
    let mut mean = |of: &[f32]| {
        photometric_error(&shape, of, &target, &mut error);
        let counted = error.iter().zip(&inside).filter(|(_, inside)| **inside);
        counted.map(|(e, _)| f64::from(*e)).sum::<f64>() / seen_pixels as f64
    };
    Some((mean(&warped), mean(&unwarped)))
}

/// The pixel's position in the other frame, and its depth there.
fn carried(
    predicted: &PredictedFrame,
    source_from_target: &Se3,
    x: usize,
    y: usize,
) -> Option<(f64, f64, f64)> {
    let depth = predicted.depth.get(x, y)?;
    let here = predicted
        .camera
        .back_project(x as f64, y as f64, f64::from(depth));
    let there: Vector3<f64> = source_from_target.transform(&here);
    let pixel = predicted.camera.project(&there)?;
    Some((pixel.x, pixel.y, there.z))
}

/// The median over pixels of |ln(warped depth / the other frame's own depth)|.
fn consistency(
    predicted: &PredictedFrame,
    other: &DepthMap,
    source_from_target: &Se3,
) -> Option<f64> {
    let mut differences = Vec::new();
    for y in (0..predicted.depth.height).step_by(2) {
        for x in (0..predicted.depth.width).step_by(2) {
            if let Some((u, v, z)) = carried(predicted, source_from_target, x, y)
                && u >= 0.0
                && v >= 0.0
                && let Some(depth) = other.get(u.round() as usize, v.round() as usize)
            {
                differences.push((z / f64::from(depth)).ln().abs());
            }
        }
    }
    median(&differences)
}

/// The median over pixels of |ln(depth of the mirrored image, mirrored back / depth)|.
fn flip(depth: &DepthMap, mirrored: &DepthMap) -> Option<f64> {
    if (depth.width, depth.height) != (mirrored.width, mirrored.height) {
        return None;
    }
    let pixels = (0..depth.width * depth.height).filter_map(|i| {
        let (x, y) = (i % depth.width, i / depth.width);
        let (a, b) = (depth.get(x, y)?, mirrored.get(x, y)?);
        Some(f64::from(a / b).ln().abs())
    });
    median(&pixels.collect::<Vec<_>>())
}
