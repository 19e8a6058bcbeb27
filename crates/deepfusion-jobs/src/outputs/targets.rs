use std::path::{Path, PathBuf};

use deepfusion_data::{RgbImage, save_png};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{
    ConfidenceModel, Evidence, FreeSpace, Perception, Rays, Surroundings, without_flying_pixels,
};
use deepfusion_render::{birds_eye, box_overlay, target_segments};
use deepfusion_runtime::Prediction;

use super::DepthOutput;
use super::depth::write_cloud;
use crate::Result;

/// A form in which a frame's targets are written, beside their JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TargetOutput {
    /// Depth as 16-bit PNG, metres × 256, as the viewer shows it. Written with the prediction ([`super::DepthWriter`]).
    DepthPng,
    /// The standard deviation of depth; also written with the prediction.
    Sigma,
    /// The image with boxes.
    Overlay,
    /// The road from above: free space, boxes, velocities.
    BirdsEye,
    /// Disparity, with each target in its own colour.
    Segments,
    /// Coloured point cloud in the camera's axes as PLY, without the points that float between near and far surfaces.
    Ply,
    /// The same cloud as PCD.
    Pcd,
}

impl TargetOutput {
    /// All forms.
    pub const ALL: [Self; 7] = [
        Self::DepthPng,
        Self::Sigma,
        Self::Overlay,
        Self::BirdsEye,
        Self::Segments,
        Self::Ply,
        Self::Pcd,
    ];

    /// The name for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DepthPng => "depth-png",
            Self::Sigma => "sigma",
            Self::Overlay => "overlay",
            Self::BirdsEye => "birds-eye",
            Self::Segments => "segments",
            Self::Ply => "ply",
            Self::Pcd => "pcd",
        }
    }

    /// The ending of its file's name, after the frame's name.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::DepthPng => "_depth.png",
            Self::Sigma => "_sigma.npy",
            Self::Overlay => "_overlay.png",
            Self::BirdsEye => "_birds_eye.png",
            Self::Segments => "_segments.png",
            Self::Ply => ".ply",
            Self::Pcd => ".pcd",
        }
    }

    /// Path of a frame's file.
    #[must_use]
    pub fn path(self, folder: &Path, name: &str) -> PathBuf {
        folder.join(self.file(name))
    }

    /// The name of a frame's file.
    pub(super) fn file(self, name: &str) -> String {
        format!("{name}{}", self.ending())
    }

    /// The output of the prediction that it stands for, if any.
    #[must_use]
    pub fn of_prediction(self) -> Option<DepthOutput> {
        match self {
            Self::DepthPng => Some(DepthOutput::DepthPng),
            Self::Sigma => Some(DepthOutput::Sigma),
            _ => None,
        }
    }

    /// Pictures that are only made of targets, never of a prediction.
    pub(super) const PICTURES: [Self; 3] = [Self::Overlay, Self::BirdsEye, Self::Segments];
}

/// Size of the cells of free space, and its range, in metres.
const GRID: (f32, f32) = (0.25, 50.0);
/// Size of the bird's-eye view, in pixels.
const BIRDS_EYE: (u32, u32) = (480, 600);

/// A picture or a cloud to write.
#[derive(Debug)]
pub enum Drawing {
    /// A picture, as PNG.
    Image(RgbImage),
    /// A cloud, written as PLY or PCD according to its file's extension.
    Cloud(PointCloud),
}

/// A frame at the working size of the perception, and what was found in it.
#[derive(Clone, Copy)]
pub struct TargetScene<'a> {
    /// The image at its own size, and its camera.
    pub image: (&'a RgbImage, &'a Intrinsics),
    /// Depth at the working size in metres, and the camera at that size.
    pub depth: (&'a DepthMap, &'a Intrinsics),
    /// The standard deviation of that depth in metres, if the network predicts it.
    pub sigma: Option<&'a DepthMap>,
    /// What was found.
    pub surroundings: &'a Surroundings,
    /// The perception that found it.
    pub perception: &'a Perception,
    /// The confidence of each pixel of the prediction, if it was calibrated.
    pub confidence: Option<(&'a ConfidenceModel, &'a Prediction)>,
}

/// Draws what was requested, if possible: without ground there is no bird's-eye view.
#[must_use]
pub fn draw(save: &[TargetOutput], scene: &TargetScene) -> Vec<(TargetOutput, Drawing)> {
    let (surroundings, perception) = (scene.surroundings, scene.perception);
    let (targets, (depth, k)) = (&surroundings.targets, scene.depth);
    let picture = |save: TargetOutput| match save {
        TargetOutput::DepthPng | TargetOutput::Sigma => None,
        TargetOutput::Overlay => {
            let (image, camera) = scene.image;
            Some(Drawing::Image(box_overlay(image, camera, targets)))
        }
        TargetOutput::BirdsEye => surroundings.ground.as_ref().map(|ground| {
            let mut space = FreeSpace::new(GRID.0, GRID.1);
            let rays = Rays::of(k);
            space.fill(
                &depth.data,
                perception.obstacles(),
                &rays,
                ground,
                perception.config(),
            );
            let ahead_m = f64::from(GRID.1);
            Drawing::Image(birds_eye(ground, Some(&space), targets, ahead_m, BIRDS_EYE))
        }),
        TargetOutput::Segments => Some(Drawing::Image(target_segments(
            depth,
            targets,
            &surroundings.detections,
        ))),
        TargetOutput::Ply | TargetOutput::Pcd => cloud(scene).map(Drawing::Cloud),
    };
    save.iter()
        .filter_map(|save| Some((*save, picture(*save)?)))
        .collect()
}

/// The cloud at the working size, each point with the image's colour there.
fn cloud(scene: &TargetScene) -> Option<PointCloud> {
    let ((image, _), (depth, k)) = (scene.image, scene.depth);
    let config = scene.perception.config();
    let rgb = deepfusion_data::resize_rgb(image, depth.width as u32, depth.height as u32);
    let clean = without_flying_pixels(depth, config.edge_radius, config.edge_jump.max(0.02));
    let far = config.max_depth_m;
    let mut cloud = PointCloud::from_depth(&clean, k, Some(rgb.as_raw()), far).ok()?;
    cloud.confidence = scene.confidence.map(|(model, prediction)| {
        let trust = confidences(model, prediction, depth.width, depth.height);
        PointCloud::column(&trust, &clean, far)
    });
    let sigma = scene.sigma;
    cloud.sigma = sigma.map(|sigma| PointCloud::column(&sigma.data, &clean, far));
    // One value for each point: the same pixels were kept.
    cloud.check().is_ok().then_some(cloud)
}

/// The confidence of each pixel of a `width` × `height` image, taken from the network's pixel there: the model was learned from gradients
/// at the network's own size, and applies only to those.
fn confidences(
    model: &ConfidenceModel,
    prediction: &Prediction,
    width: usize,
    height: usize,
) -> Vec<f32> {
    let evidence = Evidence::of(&prediction.disparity, None, prediction.width);
    let place = |i: usize, size: usize, whole: u32, from: u32, part: u32, cells: usize| {
        let pixel = (2 * i + 1) * whole as usize / (2 * size);
        let inside = pixel
            .saturating_sub(from as usize)
            .min(part.max(1) as usize - 1);
        inside * cells / part.max(1) as usize
    };
    let [x, y, w, h] = prediction.window;
    let [all_w, all_h] = prediction.image_size;
    let columns: Vec<usize> = (0..width)
        .map(|u| place(u, width, all_w, x, w, prediction.width))
        .collect();
    (0..height)
        .flat_map(|v| {
            let row = place(v, height, all_h, y, h, prediction.height) * prediction.width;
            columns.iter().map(move |u| row + u)
        })
        .map(|i| model.confidence(&evidence[i]) as f32)
        .collect()
}

impl Drawing {
    /// Writes the drawing atomically, without waiting for the disk.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        match self {
            Self::Image(picture) => Ok(save_png(picture, path)?),
            Self::Cloud(cloud) => {
                let pcd = path.extension().is_some_and(|ending| ending == "pcd");
                write_cloud(cloud, pcd, path)
            }
        }
    }
}
