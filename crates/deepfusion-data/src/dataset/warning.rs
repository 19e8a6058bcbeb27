//! What of a recording was taken for granted, looks odd or cannot be read, though it was opened.

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

/// What of a recording was taken for granted, looks odd or cannot be read, though it was opened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataWarning {
    /// The camera and its lens.
    #[error(transparent)]
    Camera(#[from] CameraWarning),
    /// Where the sensors are on the vehicle.
    #[error(transparent)]
    Mount(#[from] MountWarning),
    /// When something was measured.
    #[error(transparent)]
    Times(#[from] TimesWarning),
    /// The vehicle's speeds and turns.
    #[error(transparent)]
    Motion(#[from] MotionWarning),
    /// What is left out, is not there or cannot be read.
    #[error(transparent)]
    Incomplete(#[from] IncompleteWarning),
    /// A video's frames are decoded into the user's cache folder.
    #[error(
        "nothing can be written beside the video: its decoded frames are kept in {} (cache in dataset.toml names another folder)",
        folder.display()
    )]
    FramesElsewhere {
        /// Where they are kept.
        folder: PathBuf,
    },
    /// What the layout of another crate says, in a sentence ([`crate::Recording`] is open).
    #[error("{0}")]
    Other(Cow<'static, str>),
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::SourceDamage;

    /// One of each kind: what a kind says itself is tested beside it.
    #[test]
    fn a_warning_says_what_its_kind_says() {
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
        let said = [
            "the lens' distortion is taken out of the images; fx, fy, cx, cy are those of the result",
            "nothing says where the LiDAR is (cam_from_lidar): its scans give no ground truth",
            "the video has no time stamps: set fps in dataset.toml",
            "course.csv: not read, as it has no column course_rate_radps",
            "the bag is damaged: it ends early",
            "nothing can be written beside the video: its decoded frames are kept in frames (cache in dataset.toml names another folder)",
            "its gyroscope was warm",
        ];
        assert_eq!(warnings.map(|warning| warning.to_string()), said);
    }
}
