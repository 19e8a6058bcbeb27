//! What was found at a path without a recording of a known layout.

use deepfusion_hint::count_of;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// The known layouts, each with what it is recognised by.
const KNOWN_LAYOUTS: &str = "\nknown layouts: image folder (.png or .jpg, here or in images/), video (.mp4, .mkv, .mov, .avi, .hevc, .m4v or .webm), \
     ROS bag (.bag, .mcap or .db3), KITTI raw (image_02/), KITTI odometry (sequences/), KITTI-360 (data_2d_raw/), nuScenes (v1.0-mini/), \
     comma2k19 (processed_log/), RGB-D (frame-000000.color.png)";

/// What was found at a path without a recording of a known layout.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FoundInstead {
    /// A part of a drive.
    PartOf {
        /// Path of the drive's folder.
        drive: PathBuf,
    },
    /// A ROS 2 bag, which this build cannot read.
    Ros2Bag,
    /// A single image.
    Image,
    /// An archive.
    Archive,
    /// A file of an unknown kind.
    File,
    /// A folder without files.
    Empty,
    /// Files of known kinds, but not in a known layout.
    Files {
        /// Number of files of each kind.
        kinds: BTreeMap<FileKind, usize>,
    },
    /// A folder with only files of unknown kinds.
    Others {
        /// Number of files in it and in its folders.
        files: usize,
        /// Number of folders in it.
        folders: usize,
        /// Path of one of them, relative to the folder.
        such_as: PathBuf,
    },
}

/// Kinds of files that recordings consist of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum FileKind {
    /// `.bin` files, usually LiDAR scans.
    Bin,
    /// ROS 2 bags.
    Ros2Bags,
    /// ROS 1 bags.
    RosBags,
    /// PNG or JPEG images.
    Images,
    /// Archives, such as `.zip`.
    Archives,
    /// Videos.
    Videos,
}

impl FileKind {
    fn name(self) -> &'static str {
        match self {
            Self::Bin => ".bin file",
            Self::Ros2Bags => "ROS 2 bag",
            Self::RosBags => "ROS bag",
            Self::Images => "image",
            Self::Archives => "packed archive",
            Self::Videos => "video",
        }
    }
}

impl FoundInstead {
    /// Whether ROS 2 bags were found.
    #[must_use]
    pub fn has_ros2_bags(&self) -> bool {
        match self {
            Self::Ros2Bag => true,
            Self::Files { kinds } => kinds.contains_key(&FileKind::Ros2Bags),
            _ => false,
        }
    }
}

impl FoundInstead {
    /// The known layouts, on a line of their own, where what was found does not say what is wrong.
    pub(super) fn known_layouts(&self) -> &'static str {
        match self {
            Self::File | Self::Files { .. } | Self::Others { .. } => KNOWN_LAYOUTS,
            Self::PartOf { .. } | Self::Ros2Bag | Self::Image | Self::Archive | Self::Empty => "",
        }
    }
}

impl fmt::Display for FoundInstead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PartOf { drive } => write!(f, "it is part of the drive {}", drive.display()),
            Self::Ros2Bag => f.write_str("it is a ROS 2 bag"),
            Self::Image => f.write_str("it is a single image"),
            Self::Archive => f.write_str("it is an archive that has not been unpacked"),
            Self::File => f.write_str("it is a file"),
            Self::Empty => f.write_str("it is empty"),
            Self::Files { kinds } => {
                let list = kinds.iter().map(|(kind, n)| count_of(*n, kind.name()));
                let list = list.collect::<Vec<_>>().join(", ");
                write!(f, "it has {list}, but in no known layout")
            }
            Self::Others {
                files,
                folders,
                such_as,
            } => {
                let files = count_of(*files, "file");
                let in_folders = match folders {
                    0 => String::new(),
                    _ => format!(" and {}", count_of(*folders, "folder")),
                };
                write!(
                    f,
                    "it has {files}{in_folders}, such as {}",
                    such_as.display()
                )
            }
        }?;
        if cfg!(not(feature = "ros2")) && self.has_ros2_bags() {
            f.write_str(
                ", and this program was built without the feature `ros2` (`ros2-sqlite` for .db3)",
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_video_extension_is_listed() {
        for ending in deepfusion_video::VIDEO_ENDINGS {
            let named = KNOWN_LAYOUTS
                .split([' ', ',', '(', ')'])
                .any(|word| word == format!(".{ending}"));
            assert!(named, "{ending}");
        }
    }
}
