//! Which part of a recording is missing, and where it is had from.

use std::borrow::Cow;

/// A part of a recording that is needed and not there, by what it would hold.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MissingPart {
    /// KITTI raw: the cameras' calibration of a date.
    #[error("the cameras' intrinsics")]
    Intrinsics,
    /// KITTI raw: the velodyne's calibration of a date.
    #[error("the velodyne's place")]
    VelodynePlace,
    /// The same, for labelled boxes.
    #[error("the velodyne's place, in whose axes the boxes are")]
    AxesOfBoxes,
    /// KITTI raw: the inertial unit's calibration of a date.
    #[error("the IMU's place")]
    ImuPlace,
    /// KITTI raw: the packets of the inertial unit.
    #[error("the car's speed and yaw rate")]
    Oxts,
    /// The same, after they were read once.
    #[error("the car's speed and yaw rate")]
    OxtsGone,
    /// KITTI raw: a file of time stamps.
    #[error("the time of every frame")]
    TimeStamps,
    /// KITTI raw: a drive's tracklets.
    #[error("the labelled boxes of traffic")]
    Tracklets,
    /// KITTI's object frames: the image of a label file.
    #[error("the image of a labelled frame")]
    LabelledImage,
    /// KITTI odometry: the calibration of a sequence.
    #[error("the cameras' projections P0 to P3")]
    SequenceProjections,
    /// KITTI odometry: the times of a sequence.
    #[error("the time of every frame")]
    SequenceTimes,
    /// KITTI-360: the cameras' calibration.
    #[error("the cameras' intrinsics")]
    Kitti360Intrinsics,
    /// KITTI-360: where the cameras are on the vehicle.
    #[error("where the cameras are")]
    Kitti360Cameras,
    /// KITTI-360: where the velodyne is.
    #[error("where the velodyne is")]
    Kitti360Velodyne,
    /// nuScenes: a table.
    #[error("a table of the data set")]
    NuScenesTable,
    /// comma2k19: the times of a segment's frames.
    #[error("the times of the frames")]
    SegmentTimes,
    /// Another layout's motion ([`crate::Recording`] is open).
    #[error("times and speeds of the frames")]
    Motion,
    /// What the layout of another crate says.
    #[error("{what}")]
    Other {
        /// What it would hold.
        what: Cow<'static, str>,
        /// How to get it.
        hint: Cow<'static, str>,
    },
}

impl MissingPart {
    pub(super) fn hint(&self) -> &str {
        match self {
            Self::Intrinsics | Self::VelodynePlace | Self::ImuPlace => {
                "put the calibration files of that date (KITTI offers them as <date>_calib.zip) into the date folder"
            }
            Self::AxesOfBoxes => "fetch the date's calibration files",
            Self::Oxts => "fetch the drive's oxts folder: its speeds are what makes depth metric",
            Self::OxtsGone => "open the recording again: it changed meanwhile",
            Self::TimeStamps => {
                "fetch the drive's time stamps: ego-motion uses real time, not a nominal frame rate"
            }
            Self::Tracklets => "fetch the drive's tracklets, or evaluate without them",
            Self::LabelledImage => "fetch the images, or leave its label file out",
            Self::SequenceProjections => {
                "put the sequence's calibration there (data_odometry_calib.zip)"
            }
            Self::SequenceTimes => "put the sequence's times there (data_odometry_calib.zip)",
            Self::Kitti360Intrinsics | Self::Kitti360Cameras | Self::Kitti360Velodyne => {
                "put KITTI-360's calibration files (calibration.zip) beside data_2d_raw"
            }
            Self::NuScenesTable => "unpack the data set's metadata (v1.0-*_meta.tgz) again",
            Self::SegmentTimes => "fetch global_pose of the segment",
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
    fn the_message_says_what_is_missing_and_the_hint_where_it_is_had() {
        let error = Error::Missing {
            path: "oxts".into(),
            part: MissingPart::Other {
                what: "the wheels' speeds".into(),
                hint: "record them".into(),
            },
        };
        assert_eq!(
            error.to_string(),
            "oxts: missing, it holds the wheels' speeds"
        );
        assert_eq!(error.hint().as_deref(), Some("record them"));
    }
}
