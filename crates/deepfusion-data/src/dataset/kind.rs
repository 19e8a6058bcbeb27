//! The names of the layouts.

use serde::{Deserialize, Serialize};

/// Layout of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatasetKind {
    /// KITTI raw.
    KittiRaw,
    /// A sequence of KITTI's odometry benchmark.
    KittiOdometry,
    /// KITTI-360.
    #[serde(rename = "kitti_360")]
    Kitti360,
    /// A scene of nuScenes.
    #[serde(rename = "nuscenes")]
    NuScenes,
    /// A folder of images with tables beside it.
    Folder,
    /// A video file with tables beside it.
    Video,
    /// A comma2k19 segment.
    Comma2k19,
    /// A folder of colour, depth and pose files, as in 7-Scenes.
    RgbD,
    /// A ROS bag.
    Bag,
    /// A layout from another crate, which implements [`crate::Recording`].
    Other,
}

impl DatasetKind {
    /// The layout's name, as printed.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::KittiRaw => "KITTI raw",
            Self::KittiOdometry => "KITTI odometry",
            Self::Kitti360 => "KITTI-360",
            Self::NuScenes => "nuScenes",
            Self::Folder => "image folder",
            Self::Video => "video",
            Self::Comma2k19 => "comma2k19 segment",
            Self::RgbD => "RGB-D folder",
            Self::Bag => "ROS bag",
            Self::Other => "recording",
        }
    }
    /// Whether its recordings include a calibration, so that none can be given.
    pub(crate) fn has_own_calibration(self) -> bool {
        use DatasetKind::{Kitti360, KittiOdometry, KittiRaw, NuScenes};
        matches!(self, KittiRaw | KittiOdometry | Kitti360 | NuScenes)
    }
}
