//! The files of one prediction.

use std::path::Path;

use deepfusion_data::{RgbImage, save_png, write_depth_png};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_jobs::bulk::VIDEO_ENDING;
use deepfusion_jobs::intervals;
use deepfusion_render::{DepthScale, depth_picture, side_by_side, with_depth_legend};
use deepfusion_runtime::{LayerMaps, Prediction};

use super::features;
use crate::cli::Save;
use crate::error::CliError;
use crate::failure::{Failure, Result};
use crate::output;

/// What the name of an output ends with, after its image's.
pub(super) fn ending(save: Save) -> &'static str {
    match save {
        Save::DepthPng => "_depth.png",
        Save::Npy => "_depth.npy",
        Save::Sigma => "_sigma.npy",
        Save::Confidence => "_confidence.npy",
        Save::Color => "_color.png",
        Save::Image => "_image.jpg",
        Save::SideBySide => "_side.png",
        Save::Ply => ".ply",
        Save::Pcd => ".pcd",
        Save::Features => "_features.png",
        Save::Video => VIDEO_ENDING,
    }
}

/// What the network says of an image.
pub(super) struct Maps<'a> {
    pub prediction: &'a Prediction,
    /// At the image's own size.
    pub depth: &'a DepthMap,
    /// Where [`Save::Features`] was asked for.
    pub layers: &'a [LayerMaps],
    /// The standard deviation of `depth`, where the network says it and an output has it.
    pub sigma: Option<&'a DepthMap>,
}

/// Writes one output, whole or not at all, without waiting for the disk.
pub(super) fn write(
    save: Save,
    (max_depth_m, max_sigma): (f64, Option<f64>),
    image: &RgbImage,
    camera: Option<&Intrinsics>,
    maps: &Maps,
    path: &Path,
) -> Result<()> {
    let Maps {
        prediction,
        depth,
        layers,
        sigma,
    } = maps;
    let scale = DepthScale::default();
    match save {
        Save::DepthPng => write_depth_png(depth, path)?,
        Save::Npy => write_npy(depth, path)?,
        Save::Sigma => {
            write_npy(sigma.ok_or(CliError::NoUncertainty)?, path)?;
        }
        Save::Confidence => {
            let sigma = sigma.ok_or(CliError::NoUncertainty)?;
            write_npy(&Prediction::confidence_of(depth, sigma), path)?;
        }
        Save::Color => {
            let picture = with_depth_legend(&depth_picture(depth, &scale), &scale);
            save_png(&picture, path)?;
        }
        Save::Image => save_jpeg(image, path)?,
        // Of all images, by `video`.
        Save::Video => {}
        Save::SideBySide => save_png(&side_by_side(image, depth, &scale)?, path)?,
        Save::Features => {
            let picture = features::picture(image, depth, prediction.window, layers)?;
            save_png(&picture, path)?;
        }
        Save::Ply | Save::Pcd => {
            let k = camera.ok_or(CliError::NoCamera)?;
            let rgb = Some(image.as_raw().as_slice());
            let far = max_depth_m as f32;
            let sure;
            let depth = match (sigma, max_sigma) {
                (Some(sigma), Some(most)) => {
                    sure = intervals::without_unsure(depth, sigma, most);
                    &sure
                }
                _ => *depth,
            };
            let mut cloud = PointCloud::from_depth(depth, k, rgb, far)?;
            cloud.sigma = sigma.map(|sigma| PointCloud::column(&sigma.data, depth, far));
            let failed = |e| deepfusion_data::Error::file(path, e).into();
            deepfusion_fs::write_unsynced::<Failure>(path, failed, |out| match save {
                Save::Pcd => Ok(cloud.write_pcd(out)?),
                _ => Ok(cloud.write_ply(out)?),
            })?;
        }
    }
    Ok(())
}

fn save_jpeg(image: &RgbImage, path: &Path) -> Result<()> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 90).encode_image(image)?;
    output::write_unsynced(path, bytes)
}

fn write_npy(map: &DepthMap, path: &Path) -> Result<()> {
    let view = ndarray::ArrayView2::from_shape((map.height, map.width), &map.data)?;
    let mut bytes = Vec::new();
    ndarray_npy::WriteNpyExt::write_npy(&view, &mut bytes)?;
    output::write_unsynced(path, bytes)
}
