//! A frame of a recording: an image that has not been read yet.

use std::fmt;
use std::path::{Path, PathBuf};

/// One image and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of its drive.
    pub drive: String,
    /// Its number in the drive; numbers may be missing. Frames with consecutive numbers are neighbours.
    pub number: u64,
    /// Seconds from the drive's first time stamp; `None` if the frame has no time stamp.
    pub time_s: Option<f64>,
    /// Location of its image.
    pub image: FrameImage,
    /// The vehicle's forward speed at that time, in m/s; `None` if unknown.
    pub speed_mps: Option<f64>,
}

/// Location of a frame's image. Read the image with [`crate::Dataset::load_image`]: it may have to be decoded and
/// corrected for lens distortion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FrameImage {
    /// The image is a file of its own.
    File(PathBuf),
    /// One of many images in a file, such as a video or a bag.
    Within {
        /// Path of that file.
        file: PathBuf,
        /// Number of the image in that file, counted from 0.
        index: u64,
    },
}

impl FrameImage {
    /// Path of the file that contains the image, alone or with others.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Within { file: path, .. } => path,
        }
    }

    /// Path of the image's own file, if it has one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Within { .. } => None,
        }
    }
}

impl fmt::Display for FrameImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Within { file, index } => write!(f, "{}, image {index}", file.display()),
        }
    }
}
