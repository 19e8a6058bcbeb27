//! Why a camera cannot be an image's.

use std::path::{Path, PathBuf};

use deepfusion_geometry::ImplausibleCamera;

/// Why a camera cannot be an image's.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitCamera {
    /// No camera is like that.
    #[error(transparent)]
    Implausible(ImplausibleCamera),
    /// It is that of images of another size.
    #[error("{}", other_size(file.as_deref(), *made_for, *image))]
    OtherSize {
        /// The calibration's file, where it is one for a lens.
        file: Option<PathBuf>,
        /// Width and height of its images.
        made_for: (u32, u32),
        /// Those of this one.
        image: (u32, u32),
    },
}

fn other_size(file: Option<&Path>, made_for: (u32, u32), image: (u32, u32)) -> String {
    let ((width, height), (w, h)) = (made_for, image);
    match file {
        None => format!("the calibration is for {width}x{height}, the image has {w}x{h}"),
        Some(file) => format!(
            "{} is for images of {width}x{height}, this one has {w}x{h}",
            file.display()
        ),
    }
}
