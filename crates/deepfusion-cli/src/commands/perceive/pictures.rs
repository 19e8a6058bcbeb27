//! The pictures and clouds of a frame.

use std::path::{Path, PathBuf};

use deepfusion_data::{RgbImage, save_png};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{
    ConfidenceModel, Evidence, FreeSpace, Perception, Rays, Surroundings, without_flying_pixels,
};
use deepfusion_render::{birds_eye, box_overlay, target_segments};
use deepfusion_runtime::Prediction;

use crate::cli::PerceiveSave;
use crate::failure::{Failure, Result};

/// Cells of the free space and how far it reaches, metres.
const GRID: (f32, f32) = (0.25, 50.0);
/// Size of the bird's-eye view, pixels.
const BIRDS_EYE: (u32, u32) = (480, 600);

/// Something to be written.
pub(crate) enum Picture {
    /// As PNG.
    Image(RgbImage),
    /// As PLY or PCD, by its file's ending.
    Cloud(PointCloud),
}

/// Draws what was asked for and can be: without ground there is no bird's-eye view.
pub(crate) fn draw(
    save: &[PerceiveSave],
    image: &RgbImage,
    camera: &Intrinsics,
    (depth, sigma, k): (&DepthMap, Option<&DepthMap>, &Intrinsics),
    surroundings: &Surroundings,
    perception: &Perception,
    confidence: Option<(&ConfidenceModel, &Prediction)>,
) -> Vec<(PerceiveSave, Picture)> {
    let targets = &surroundings.targets;
    let picture = |save: PerceiveSave| match save {
        // Written with the prediction.
        PerceiveSave::DepthPng | PerceiveSave::Sigma => None,
        PerceiveSave::Overlay => Some(Picture::Image(box_overlay(image, camera, targets))),
        PerceiveSave::BirdsEye => surroundings.ground.as_ref().map(|ground| {
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
            Picture::Image(birds_eye(ground, Some(&space), targets, ahead_m, BIRDS_EYE))
        }),
        PerceiveSave::Segments => Some(Picture::Image(target_segments(
            depth,
            targets,
            &surroundings.detections,
        ))),
        PerceiveSave::Ply | PerceiveSave::Pcd => {
            cloud(image, (depth, sigma, k), perception, confidence).map(Picture::Cloud)
        }
    };
    save.iter()
        .filter_map(|save| Some((*save, picture(*save)?)))
        .collect()
}

/// The cloud at the working size, each point with the image's colour there.
fn cloud(
    image: &RgbImage,
    (depth, sigma, k): (&DepthMap, Option<&DepthMap>, &Intrinsics),
    perception: &Perception,
    confidence: Option<(&ConfidenceModel, &Prediction)>,
) -> Option<PointCloud> {
    let config = perception.config();
    let rgb = deepfusion_data::resize_rgb(image, depth.width as u32, depth.height as u32);
    let clean = without_flying_pixels(depth, config.edge_radius, config.edge_jump.max(0.02));
    let far = config.max_depth_m;
    let mut cloud = PointCloud::from_depth(&clean, k, Some(rgb.as_raw()), far).ok()?;
    cloud.confidence = confidence.map(|(model, prediction)| {
        let trust = confidences(model, prediction, depth.width, depth.height);
        PointCloud::column(&trust, &clean, far)
    });
    cloud.sigma = sigma.map(|sigma| PointCloud::column(&sigma.data, &clean, far));
    // One a point: the same pixels were kept.
    cloud.check().is_ok().then_some(cloud)
}

/// The confidence of each pixel of a `width` × `height` image: that of the network's pixel there, for a gradient means
/// what it meant when it was learned only at the network's own size.
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

/// Where a frame's picture goes.
pub(crate) fn path(out: &Path, name: &str, save: PerceiveSave) -> PathBuf {
    out.join(match save {
        PerceiveSave::DepthPng => format!("{name}_depth.png"),
        PerceiveSave::Sigma => format!("{name}_sigma.npy"),
        PerceiveSave::Overlay => format!("{name}_overlay.png"),
        PerceiveSave::BirdsEye => format!("{name}_birds_eye.png"),
        PerceiveSave::Segments => format!("{name}_segments.png"),
        PerceiveSave::Ply => format!("{name}.ply"),
        PerceiveSave::Pcd => format!("{name}.pcd"),
    })
}

impl Picture {
    /// Writes it, atomically.
    pub(crate) fn save(&self, path: &Path) -> Result<()> {
        match self {
            Self::Image(picture) => save_png(picture, path)?,
            Self::Cloud(cloud) => {
                let pcd = path.extension().is_some_and(|ending| ending == "pcd");
                let failed = |e| deepfusion_data::Error::file(path, e).into();
                deepfusion_fs::write_unsynced::<Failure>(path, failed, |out| {
                    if pcd {
                        Ok(cloud.write_pcd(out)?)
                    } else {
                        Ok(cloud.write_ply(out)?)
                    }
                })?;
            }
        }
        Ok(())
    }
}
