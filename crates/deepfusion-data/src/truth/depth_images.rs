//! Reads folders of depth images.

use crate::{Error, ImageProblem, Result};
use deepfusion_geometry::DepthMap;
use deepfusion_images::decode;
use image::DynamicImage;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Depth images by frame number, and the meaning of their values.
#[derive(Debug, Clone)]
pub(crate) struct DepthImages {
    pub(crate) files: BTreeMap<u64, PathBuf>,
    /// Metres per unit of the values.
    pub(crate) unit_m: f64,
    /// A value besides 0 that means no depth.
    pub(crate) invalid: Option<u16>,
}

impl DepthImages {
    /// Reads a 16-bit grey PNG as depth in metres.
    pub(crate) fn read(&self, path: &Path) -> Result<DepthMap> {
        let DynamicImage::ImageLuma16(image) = decode(path)? else {
            return Err(Error::Image {
                path: path.to_owned(),
                problem: ImageProblem::NotDepth,
            });
        };
        let metres = |value: &u16| {
            if Some(*value) == self.invalid {
                0.0
            } else {
                (f64::from(*value) * self.unit_m) as f32
            }
        };
        Ok(DepthMap {
            width: image.width() as usize,
            height: image.height() as usize,
            data: image.as_raw().iter().map(metres).collect(),
        })
    }
}
