//! What lies at a path where no recording of a known layout is.

use deepfusion_hint::count_of;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// What lies at a path that is no recording of a known layout.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FoundInstead {
    /// A part of a drive.
    PartOf {
        /// The drive's folder.
        drive: PathBuf,
    },
    /// A ROS 2 bag, which this build does not read.
    Ros2Bag,
    /// A single image.
    Image,
    /// An archive.
    Archive,
    /// A file of another kind.
    File,
    /// A folder without files.
    Empty,
    /// Files of known kinds, without what says how to read them.
    Files {
        /// How many there are of each kind.
        kinds: BTreeMap<FileKind, usize>,
    },
    /// A folder with nothing in it that is known.
    Others {
        /// Files in it and in its folders.
        files: usize,
        /// Folders in it.
        folders: usize,
        /// One of them, within the folder.
        such_as: PathBuf,
    },
}

/// Kinds of files that recordings are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum FileKind {
    /// `.bin`: scans, as a rule.
    Bin,
    /// Bags of ROS 2.
    Ros2Bags,
    /// Bags of ROS.
    RosBags,
    /// PNG or JPEG.
    Images,
    /// Packed archives.
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
    /// Whether bags of ROS 2 are there.
    #[must_use]
    pub fn has_ros2_bags(&self) -> bool {
        match self {
            Self::Ros2Bag => true,
            Self::Files { kinds } => kinds.contains_key(&FileKind::Ros2Bags),
            _ => false,
        }
    }
}

impl fmt::Display for FoundInstead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PartOf { drive } => write!(f, "it lies within the drive {}", drive.display()),
            Self::Ros2Bag => f.write_str("it is a ROS 2 bag"),
            Self::Image => f.write_str("it is a single image"),
            Self::Archive => f.write_str("it is an archive that is still packed"),
            Self::File => f.write_str("it is a file"),
            Self::Empty => f.write_str("it is empty"),
            Self::Files { kinds } => {
                let list = kinds.iter().map(|(kind, n)| count_of(*n, kind.name()));
                let list = list.collect::<Vec<_>>().join(", ");
                write!(f, "it holds {list} and nothing that says how to read them")
            }
            Self::Others {
                files,
                folders,
                such_as,
            } => write!(
                f,
                "it holds {} and {} (such as {})",
                count_of(*files, "file"),
                count_of(*folders, "folder"),
                such_as.display()
            ),
        }?;
        if cfg!(not(feature = "ros2")) && self.has_ros2_bags() {
            f.write_str(
                ", and this program was built without the feature `ros2` (`ros2-sqlite` for .db3)",
            )?;
        }
        Ok(())
    }
}
