//! The layouts by name.

use serde::{Deserialize, Serialize};

/// The layout a recording came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatasetKind {
    /// KITTI raw.
    KittiRaw,
    /// A folder of images with tables beside it.
    Folder,
    /// A video file with tables beside it.
    Video,
    /// A comma2k19 segment.
    Comma2k19,
    /// A folder of colour, depth and pose files, as 7-Scenes has.
    RgbD,
    /// A ROS bag.
    Bag,
    /// A layout of somebody else's: a [`crate::Recording`] from outside this crate.
    Other,
}

impl DatasetKind {
    /// Its name in text.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::KittiRaw => "KITTI raw",
            Self::Folder => "image folder",
            Self::Video => "video",
            Self::Comma2k19 => "comma2k19 segment",
            Self::RgbD => "RGB-D folder",
            Self::Bag => "ROS bag",
            Self::Other => "recording",
        }
    }
}
