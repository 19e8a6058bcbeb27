//! The measured depth on a few images of a drive.

use crate::DriveDiagnosis;
use deepfusion_data::{Camera, Cameras, Dataset, GtKind, OpenOptions, Result, RgbImage, overlay};
use std::path::Path;

/// An image with the depth that was measured on it.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthPicture {
    /// The frame's number.
    pub frame: u64,
    /// The image, near points in red and far ones in blue. Their edges should lie on the image's.
    pub image: RgbImage,
}

/// The measured depth on the images that the diagnosis of a drive chose ([`crate::DrivePlots::with_depth`]); `path` and `options` as
/// given when the recording was examined. What cannot be read is left out: it is among the findings.
///
/// # Errors
/// Those of [`Dataset::open`], and depth whose size differs from its image's.
pub fn depth_pictures(
    path: &Path,
    options: &OpenOptions,
    drive: &DriveDiagnosis,
) -> Result<Vec<DepthPicture>> {
    if drive.plots.with_depth.is_empty() {
        return Ok(Vec::new());
    }
    let options = OpenOptions {
        camera: if drive.camera == Camera::Left.number() {
            Cameras::Left
        } else {
            Cameras::Right
        },
        ..options.clone()
    };
    let datasets = Dataset::open(path, &options)?;
    let is_it = |d: &&Dataset| d.name() == drive.name && d.place() == drive.place;
    let Some(dataset) = datasets.iter().find(is_it) else {
        return Ok(Vec::new());
    };
    let mut pictures = Vec::new();
    for &frame in &drive.plots.with_depth {
        let (Ok(image), Ok(Some(depth))) = (
            dataset.load_image(frame),
            dataset.ground_truth(frame, GtKind::Z),
        ) else {
            continue;
        };
        pictures.push(DepthPicture {
            frame: dataset.frames()[frame].number,
            image: overlay(&image, &depth)?,
        });
    }
    Ok(pictures)
}
