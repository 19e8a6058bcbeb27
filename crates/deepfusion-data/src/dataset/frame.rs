//! One image of a recording, before it is read.

use std::fmt;
use std::path::{Path, PathBuf};

/// One image and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of its drive.
    pub drive: String,
    /// Its number in the drive; numbers may be missing. Frames whose numbers follow each other are
    /// neighbours.
    pub number: u64,
    /// Seconds from the drive's first time stamp; `None` where the drive has no time stamp of it.
    pub time_s: Option<f64>,
    /// Where its image is.
    pub image: FrameImage,
    /// The car's forward speed at that time, in m/s; `None` where it is unknown.
    pub speed_mps: Option<f64>,
}

/// Where a frame's image is. Read it with [`crate::Dataset::load_image`]: it may have to be decoded, and
/// freed of its lens' distortion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FrameImage {
    /// A file of its own.
    File(PathBuf),
    /// One of many in a file, such as a video or a bag.
    Within {
        /// That file.
        file: PathBuf,
        /// Which of its images, counted from 0.
        index: u64,
    },
}

impl FrameImage {
    /// The file that holds the image, alone or with others.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Within { file: path, .. } => path,
        }
    }

    /// The image's own file, if it has one.
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
