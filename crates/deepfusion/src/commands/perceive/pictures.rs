//! The pictures and clouds of a frame.

use std::path::{Path, PathBuf};

use anyhow::Result;
use deepfusion_cloud::PointCloud;
use deepfusion_data::{RgbImage, save_png, write_atomically};
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{FreeSpace, Perception, Rays, Surroundings, flying_pixels};
use deepfusion_render::{birds_eye, box_overlay, target_segments};

use crate::cli::PerceiveSave;

/// Cells of the free space and how far it reaches, metres.
const GRID: (f32, f32) = (0.25, 50.0);
/// Size of the bird's-eye view, pixels.
const BIRDS_EYE: (u32, u32) = (480, 600);

/// Something to be written.
pub enum Picture {
    /// As PNG.
    Image(RgbImage),
    /// As PLY.
    Cloud(PointCloud),
}

/// Draws what was asked for and can be: without ground there is no bird's-eye view.
pub fn draw(
    save: &[PerceiveSave],
    image: &RgbImage,
    camera: &Intrinsics,
    (depth, k): (&DepthMap, &Intrinsics),
    surroundings: &Surroundings,
    perception: &Perception,
) -> Vec<(PerceiveSave, Picture)> {
    let targets = &surroundings.targets;
    let picture = |save: PerceiveSave| match save {
        PerceiveSave::DepthPng => None,
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
        PerceiveSave::Ply => cloud(image, depth, k, perception).map(Picture::Cloud),
    };
    save.iter()
        .filter_map(|save| Some((*save, picture(*save)?)))
        .collect()
}

/// The cloud at the working size, each point with the image's colour there.
fn cloud(
    image: &RgbImage,
    depth: &DepthMap,
    k: &Intrinsics,
    perception: &Perception,
) -> Option<PointCloud> {
    let config = perception.config();
    let rgb = deepfusion_data::resize_rgb(image, depth.width as u32, depth.height as u32);
    let radius = (config.edge_radius * depth.width as f32 / 640.0).round() as usize;
    let jump = config.edge_jump.max(0.02);
    let flying = flying_pixels(&depth.data, depth.width, radius, jump);
    let keep = |(z, flies): (&f32, bool)| if flies { 0.0 } else { *z };
    let clean = DepthMap {
        width: depth.width,
        height: depth.height,
        data: depth.data.iter().zip(flying).map(keep).collect(),
    };
    PointCloud::from_depth(&clean, k, Some(rgb.as_raw()), config.max_depth_m).ok()
}

/// Where a frame's picture goes.
pub fn path(out: &Path, name: &str, save: PerceiveSave) -> PathBuf {
    out.join(match save {
        PerceiveSave::DepthPng => format!("{name}_depth.png"),
        PerceiveSave::Overlay => format!("{name}_overlay.png"),
        PerceiveSave::BirdsEye => format!("{name}_birds_eye.png"),
        PerceiveSave::Segments => format!("{name}_segments.png"),
        PerceiveSave::Ply => format!("{name}.ply"),
    })
}

impl Picture {
    /// Writes it, atomically.
    pub fn save(&self, path: &Path) -> Result<()> {
        match self {
            Self::Image(picture) => save_png(picture, path)?,
            Self::Cloud(cloud) => {
                write_atomically::<anyhow::Error>(path, |out| Ok(cloud.write_ply(out)?))?;
            }
        }
        Ok(())
    }
}

/// The frame's own image, where it is no file: a viewer needs it.
pub fn save_jpeg(image: &RgbImage, path: &Path) -> Result<()> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 90).encode_image(image)?;
    write_atomically::<deepfusion_data::Error>(path, |out| {
        std::io::Write::write_all(out, &bytes).map_err(|e| deepfusion_data::Error::file(path, e))
    })?;
    Ok(())
}
