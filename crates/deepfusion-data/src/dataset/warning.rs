//! Warnings about a recording that was opened: assumptions, oddities and unreadable parts.

use std::borrow::Cow;
use std::path::PathBuf;

mod camera;
mod incomplete;
mod motion;
mod mount;
mod times;

pub use self::camera::CameraWarning;
pub use self::incomplete::IncompleteWarning;
pub use self::motion::MotionWarning;
pub use self::mount::{MountWarning, NotByFrames};
pub use self::times::TimesWarning;

/// A warning about a recording that was opened: an assumption, an oddity or an unreadable part.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataWarning {
    /// About the camera and its lens.
    #[error(transparent)]
    Camera(#[from] CameraWarning),
    /// About the sensors' mounts on the vehicle.
    #[error(transparent)]
    Mount(#[from] MountWarning),
    /// About times.
    #[error(transparent)]
    Times(#[from] TimesWarning),
    /// About the vehicle's speeds and turns.
    #[error(transparent)]
    Motion(#[from] MotionWarning),
    /// About what is left out, missing or unreadable.
    #[error(transparent)]
    Incomplete(#[from] IncompleteWarning),
    /// A video's frames are decoded into the user's cache folder.
    #[error(
        "the video's folder is not writable: decoded frames are kept in {} (set cache in dataset.toml for another folder)",
        folder.display()
    )]
    FramesElsewhere {
        /// Path of that cache folder.
        folder: PathBuf,
    },
    /// A warning of a layout from another crate, in a sentence (anyone can implement [`crate::Recording`]).
    #[error("{0}")]
    Other(Cow<'static, str>),
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::SourceDamage;

    /// One of each kind; all messages of a kind are tested in its own file.
    #[test]
    fn a_warning_has_the_message_of_its_kind() {
        let ends_early = SourceDamage::new(std::io::Error::other("it ends early"));
        let warnings: [DataWarning; 7] = [
            CameraWarning::LensCorrected.into(),
            MountWarning::LidarUnknown.into(),
            TimesWarning::VideoUntimed.into(),
            MotionWarning::NoCourseRates.into(),
            IncompleteWarning::Damaged(ends_early).into(),
            DataWarning::FramesElsewhere {
                folder: "frames".into(),
            },
            DataWarning::Other("its gyroscope was warm".into()),
        ];
        let expected = [
            "the images are corrected for lens distortion; fx, fy, cx, cy are those of the corrected images",
            "the LiDAR's mount is not given (cam_from_lidar): its scans give no ground truth",
            "the video has no time stamps: set fps in dataset.toml",
            "course.csv: not read, since it has no column course_rate_radps",
            "the bag is damaged: it ends early",
            "the video's folder is not writable: decoded frames are kept in frames (set cache in dataset.toml for another folder)",
            "its gyroscope was warm",
        ];
        assert_eq!(warnings.map(|warning| warning.to_string()), expected);
    }
}
