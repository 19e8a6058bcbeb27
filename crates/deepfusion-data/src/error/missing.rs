//! Which part of a recording is missing, and how to get it.

use std::borrow::Cow;

/// A missing file or folder of a recording, described by its contents.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MissingPart {
    /// KITTI raw: the cameras' calibration for a date.
    #[error("the cameras' intrinsics")]
    Intrinsics,
    /// KITTI raw: the velodyne's calibration for a date.
    #[error("the velodyne's position")]
    VelodynePlace,
    /// The same file, needed for labelled boxes.
    #[error("the velodyne's position, which the labelled boxes refer to")]
    AxesOfBoxes,
    /// KITTI raw: the inertial unit's calibration for a date.
    #[error("the IMU's position")]
    ImuPlace,
    /// KITTI raw: the packets of the inertial unit.
    #[error("the vehicle's speed and yaw rate")]
    Oxts,
    /// The same packets, which existed when the recording was opened.
    #[error("the vehicle's speed and yaw rate")]
    OxtsGone,
    /// KITTI raw: a file of time stamps.
    #[error("the time of every frame")]
    TimeStamps,
    /// KITTI raw: a drive's tracklets.
    #[error("the labelled boxes")]
    Tracklets,
    /// KITTI's object frames: the image of a label file.
    #[error("the image of a labelled frame")]
    LabelledImage,
    /// KITTI odometry: a sequence's calibration.
    #[error("the cameras' projections P0 to P3")]
    SequenceProjections,
    /// KITTI odometry: a sequence's times.
    #[error("the time of every frame")]
    SequenceTimes,
    /// KITTI-360: the cameras' calibration.
    #[error("the cameras' intrinsics")]
    Kitti360Intrinsics,
    /// KITTI-360: the cameras' positions on the vehicle.
    #[error("the cameras' positions")]
    Kitti360Cameras,
    /// KITTI-360: the velodyne's position.
    #[error("the velodyne's position")]
    Kitti360Velodyne,
    /// nuScenes: a table.
    #[error("a table of the data set")]
    NuScenesTable,
    /// comma2k19: the times of a segment's frames.
    #[error("the times of the frames")]
    SegmentTimes,
    /// The motion of a layout from another crate (anyone can implement [`crate::Recording`]).
    #[error("times and speeds of the frames")]
    Motion,
    /// A part of a layout from another crate.
    #[error("{what}")]
    Other {
        /// What it should contain.
        what: Cow<'static, str>,
        /// How to get it.
        hint: Cow<'static, str>,
    },
}

impl MissingPart {
    pub(super) fn hint(&self) -> &str {
        match self {
            Self::Intrinsics | Self::VelodynePlace | Self::ImuPlace => {
                "put that date's calibration files (KITTI's <date>_calib.zip) into the date folder"
            }
            Self::AxesOfBoxes => "fetch the date's calibration files",
            Self::Oxts => "fetch the drive's oxts folder: its speeds make depth metric",
            Self::OxtsGone => "open the recording again: it has changed since it was opened",
            Self::TimeStamps => {
                "fetch the drive's time stamps: ego-motion needs the true times, not a nominal frame rate"
            }
            Self::Tracklets => "fetch the drive's tracklets, or give a drive with labelled boxes",
            Self::LabelledImage => "fetch the image, or remove its label file",
            Self::SequenceProjections => {
                "put the sequence's calibration there (data_odometry_calib.zip)"
            }
            Self::SequenceTimes => "put the sequence's times there (data_odometry_calib.zip)",
            Self::Kitti360Intrinsics | Self::Kitti360Cameras | Self::Kitti360Velodyne => {
                "put KITTI-360's calibration files (calibration.zip) beside data_2d_raw"
            }
            Self::NuScenesTable => "unpack the data set's metadata (v1.0-*_meta.tgz) again",
            Self::SegmentTimes => "fetch the segment's global_pose",
            Self::Motion => "give each frame its time and speed",
            Self::Other { hint, .. } => hint,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::MissingPart;
    use crate::Error;
    use deepfusion_hint::Hint;

    #[test]
    fn the_message_says_what_is_missing_and_the_hint_how_to_get_it() {
        let error = Error::Missing {
            path: "oxts".into(),
            part: MissingPart::Other {
                what: "the wheels' speeds".into(),
                hint: "record them".into(),
            },
        };
        assert_eq!(
            error.to_string(),
            "oxts: no such file or folder; it should contain the wheels' speeds"
        );
        assert_eq!(error.hint().as_deref(), Some("record them"));
    }
}
