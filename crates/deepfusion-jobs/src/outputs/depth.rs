use std::io::Write;
use std::path::Path;

use deepfusion_data::{RgbImage, save_png, write_depth_png};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_render::{DepthScale, depth_picture, side_by_side, with_depth_legend};
use deepfusion_runtime::{LayerMaps, Prediction};

use super::features;
use crate::bulk::VIDEO_ENDING;
use crate::{Error, Result, intervals};

/// A form in which an image's depth is written, beside its JSON sidecar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DepthOutput {
    /// 16-bit PNG, metres × 256.
    DepthPng,
    /// H×W f32 metres, for NumPy.
    Npy,
    /// The standard deviation of depth in metres, H×W f32, for NumPy; only for networks that predict uncertainty.
    Sigma,
    /// The confidence of each pixel, H×W f32 from 0 to 1, for NumPy; only for networks that predict uncertainty.
    Confidence,
    /// Depth in colours with a legend in metres.
    Color,
    /// The image as JPEG, so that the viewer can show frames of videos and bags.
    Image,
    /// The image and its depth in colours.
    SideBySide,
    /// Coloured point cloud in the camera's axes, as PLY.
    Ply,
    /// Coloured point cloud in the camera's axes, as PCD.
    Pcd,
    /// The encoder's features and attention masks on the image.
    Features,
    /// A video of each recording, from the pictures of [`Self::SideBySide`]; made once all of them exist.
    Video,
}

impl DepthOutput {
    /// All outputs.
    pub const ALL: [Self; 11] = [
        Self::DepthPng,
        Self::Npy,
        Self::Sigma,
        Self::Confidence,
        Self::Color,
        Self::Image,
        Self::SideBySide,
        Self::Ply,
        Self::Pcd,
        Self::Features,
        Self::Video,
    ];

    /// The name in sidecars and for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DepthPng => "depth-png",
            Self::Npy => "npy",
            Self::Sigma => "sigma",
            Self::Confidence => "confidence",
            Self::Color => "color",
            Self::Image => "image",
            Self::SideBySide => "side-by-side",
            Self::Ply => "ply",
            Self::Pcd => "pcd",
            Self::Features => "features",
            Self::Video => "video",
        }
    }

    /// The ending of its file's name, after the image's name.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::DepthPng => "_depth.png",
            Self::Npy => "_depth.npy",
            Self::Sigma => "_sigma.npy",
            Self::Confidence => "_confidence.npy",
            Self::Color => "_color.png",
            Self::Image => "_image.jpg",
            Self::SideBySide => "_side.png",
            Self::Ply => ".ply",
            Self::Pcd => ".pcd",
            Self::Features => "_features.png",
            Self::Video => VIDEO_ENDING,
        }
    }

    /// Whether it is a point cloud, which needs the camera.
    #[must_use]
    pub fn is_cloud(self) -> bool {
        matches!(self, Self::Ply | Self::Pcd)
    }

    /// Whether it needs a network that predicts uncertainty.
    #[must_use]
    pub fn needs_uncertainty(self) -> bool {
        matches!(self, Self::Sigma | Self::Confidence)
    }
}

/// Which points of a cloud are left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudLimits {
    /// Points beyond this depth, in metres.
    pub max_depth_m: f64,
    /// Points whose standard deviation is above this share of their depth.
    pub max_sigma: Option<f64>,
}

/// The outputs that are written for every image of a run.
#[derive(Debug, Clone)]
pub struct DepthOutputs {
    /// The outputs besides the sidecar; never a video, which does not belong to a single image.
    save: Vec<DepthOutput>,
    /// Whether the images of videos, bags and live sources are saved, too, since they are not files.
    pub frames: bool,
    /// Limits of clouds.
    pub limits: CloudLimits,
}

impl DepthOutputs {
    /// The requested outputs, each once; for a video, the pictures that it is made of. `frames` is [`Self::frames`].
    #[must_use]
    pub fn of(
        asked: impl IntoIterator<Item = DepthOutput>,
        frames: bool,
        limits: CloudLimits,
    ) -> Self {
        let mut save = Vec::new();
        for output in asked {
            let of_an_image = match output {
                DepthOutput::Video => DepthOutput::SideBySide,
                other => other,
            };
            if !save.contains(&of_an_image) {
                save.push(of_an_image);
            }
        }
        Self {
            save,
            frames,
            limits,
        }
    }

    /// The outputs besides the sidecar.
    #[must_use]
    pub fn save(&self) -> &[DepthOutput] {
        &self.save
    }

    /// The outputs for one image. `is_file` says whether it is a file that a viewer of its depth can open.
    #[must_use]
    pub fn of_image(&self, is_file: bool) -> Vec<DepthOutput> {
        let mut save = self.save.clone();
        if self.frames && !is_file && !save.contains(&DepthOutput::Image) {
            save.push(DepthOutput::Image);
        }
        save
    }

    /// Whether any output needs a network that predicts uncertainty.
    #[must_use]
    pub fn need_uncertainty(&self) -> bool {
        self.limits.max_sigma.is_some() || self.save.iter().any(|save| save.needs_uncertainty())
    }

    /// Whether any output shows the network's layers.
    #[must_use]
    pub fn need_layers(&self) -> bool {
        self.save.contains(&DepthOutput::Features)
    }

    /// Whether any output contains the standard deviation, if the network predicts it.
    pub(super) fn have_sigma(&self) -> bool {
        let has = |save: &DepthOutput| save.needs_uncertainty() || save.is_cloud();
        self.save.iter().any(has)
    }
}

/// The network's results for an image.
pub(super) struct Maps<'a> {
    pub prediction: &'a Prediction,
    /// The depth at the image's own size.
    pub depth: &'a DepthMap,
    /// The layers' pictures, if [`DepthOutput::Features`] was requested.
    pub layers: &'a [LayerMaps],
    /// The standard deviation of `depth`, if the network predicts it and an output contains it.
    pub sigma: Option<&'a DepthMap>,
}

/// Writes one output atomically, without waiting for the disk.
pub(super) fn write(
    save: DepthOutput,
    limits: CloudLimits,
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
        DepthOutput::DepthPng => write_depth_png(depth, path)?,
        DepthOutput::Npy => write_npy(depth, path)?,
        DepthOutput::Sigma => write_npy(sigma.ok_or(Error::NoUncertainty)?, path)?,
        DepthOutput::Confidence => {
            let sigma = sigma.ok_or(Error::NoUncertainty)?;
            write_npy(&Prediction::confidence_of(depth, sigma), path)?;
        }
        DepthOutput::Color => {
            let picture = with_depth_legend(&depth_picture(depth, &scale), &scale);
            save_png(&picture, path)?;
        }
        DepthOutput::Image => save_jpeg(image, path)?,
        // Made from all images, by `bulk::write_videos`.
        DepthOutput::Video => {}
        DepthOutput::SideBySide => save_png(&side_by_side(image, depth, &scale)?, path)?,
        DepthOutput::Features => {
            if layers.is_empty() {
                return Err(Error::NoLayers);
            }
            let picture = features::picture(image, depth, prediction.window, layers)?;
            save_png(&picture, path)?;
        }
        DepthOutput::Ply | DepthOutput::Pcd => {
            let k = camera.ok_or(Error::NoCamera)?;
            let rgb = Some(image.as_raw().as_slice());
            let far = limits.max_depth_m as f32;
            let sure;
            let depth = match (sigma, limits.max_sigma) {
                (Some(sigma), Some(most)) => {
                    sure = intervals::without_unsure(depth, sigma, most);
                    &sure
                }
                _ => *depth,
            };
            let mut cloud = PointCloud::from_depth(depth, k, rgb, far)?;
            cloud.sigma = sigma.map(|sigma| PointCloud::column(&sigma.data, depth, far));
            write_cloud(&cloud, save == DepthOutput::Pcd, path)?;
        }
    }
    Ok(())
}

/// Writes a cloud as PCD or PLY atomically, without waiting for the disk.
pub(super) fn write_cloud(cloud: &PointCloud, pcd: bool, path: &Path) -> Result<()> {
    let failed = |e| deepfusion_data::Error::file(path, e).into();
    deepfusion_fs::write_unsynced::<Error>(path, failed, |out| {
        if pcd {
            Ok(cloud.write_pcd(out)?)
        } else {
            Ok(cloud.write_ply(out)?)
        }
    })
}

fn save_jpeg(image: &RgbImage, path: &Path) -> Result<()> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 90).encode_image(image)?;
    write_bytes(path, &bytes)
}

fn write_npy(map: &DepthMap, path: &Path) -> Result<()> {
    let view = ndarray::ArrayView2::from_shape((map.height, map.width), &map.data)?;
    let mut bytes = Vec::new();
    ndarray_npy::WriteNpyExt::write_npy(&view, &mut bytes)?;
    write_bytes(path, &bytes)
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |e| deepfusion_data::Error::file(path, e);
    Ok(deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(bytes).map_err(failed)
    })?)
}
