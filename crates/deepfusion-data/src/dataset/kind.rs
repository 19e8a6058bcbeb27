//! The layouts by name.

use serde::{Deserialize, Serialize};

/// The layout a recording came in.
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
    /// Whether its recordings say what their camera is, so that none can be given.
    pub(crate) fn brings_calibration(self) -> bool {
        use DatasetKind::{Kitti360, KittiOdometry, KittiRaw, NuScenes};
        matches!(self, KittiRaw | KittiOdometry | Kitti360 | NuScenes)
    }
}
