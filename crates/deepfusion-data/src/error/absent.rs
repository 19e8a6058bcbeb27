//! Why a recording has no frames, or no motion.

use crate::DatasetKind;
use deepfusion_hint::count_of;
use std::borrow::Cow;

/// Why a recording with other streams has no images.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoFramesReason {
    /// The folder has no image.
    #[error("no image (.png, .jpg, .jpeg)")]
    NoPicture,
    /// The RGB-D folder has no colour image.
    #[error("no frame-<number>.color.png or .jpg")]
    NoColour,
    /// None of the image files listed in the tables exists.
    #[error("no such file, nor any other image of {camera} that {table} lists in {}", count_of(*scenes, "scene"))]
    NotUnpacked {
        /// Name of the camera.
        camera: &'static str,
        /// Name of the table.
        table: &'static str,
        /// Number of scenes in the table.
        scenes: usize,
    },
    /// A topic of video packets has no key frame at which decoding could start.
    #[error(
        "{topic} has {} and no key frame among them with the parameters at which decoding can start",
        count_of(*messages, "message")
    )]
    NoKeyFrame {
        /// Name of the topic.
        topic: String,
        /// Number of its messages.
        messages: u64,
    },
    /// No topic has images.
    #[error("none of its topics has images: {}", topics.join(", "))]
    NoImageTopic {
        /// Names of all topics.
        topics: Vec<String>,
    },
}

impl NoFramesReason {
    pub(super) fn hint(&self) -> &'static str {
        match self {
            Self::NoPicture => "set images in dataset.toml to the folder of the images",
            Self::NoColour => "fetch the sequence's images",
            Self::NotUnpacked { .. } => "unpack samples and sweeps beside the folder of tables",
            Self::NoKeyFrame { .. } => {
                "record for longer than the encoder's interval between key frames, or shorten that interval"
            }
            Self::NoImageTopic { .. } => {
                "record the camera's topic too (sensor_msgs/Image or CompressedImage)"
            }
        }
    }
}

/// Why there is no ego-motion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoTrackReason {
    /// It has no measured speeds.
    #[error("no speeds")]
    NoSpeeds {
        /// The recording's layout, which determines where speeds come from.
        layout: DatasetKind,
    },
    /// Speeds could be computed from the poses, but these have no times.
    #[error("no speeds")]
    UntimedPoses,
    /// It has speeds, but the frames have no times.
    #[error("its frames have no times")]
    NoTimes,
    /// No topic of the bag has speeds.
    #[error(
        "the bag has no speed of the vehicle (TwistStamped, TwistWithCovarianceStamped, Odometry, AckermannDriveStamped, NavSatFix or a \
         CAN signal)"
    )]
    NoSpeedTopic,
    /// The reason of a layout from another crate (anyone can implement [`crate::Recording`]).
    #[error("{why}")]
    Other {
        /// What is missing.
        why: Cow<'static, str>,
        /// What to do.
        hint: Cow<'static, str>,
    },
}

impl NoTrackReason {
    pub(super) fn hint(&self) -> &str {
        match self {
            Self::NoSpeeds { layout } => speeds_from(*layout),
            Self::UntimedPoses => {
                "add the sequence's times.txt (from data_odometry_calib.zip): speeds come from poses and times"
            }
            Self::NoTimes => "add frames.csv or timestamps.txt, or set fps in dataset.toml",
            Self::NoSpeedTopic => SPEED_TOPIC,
            Self::Other { hint, .. } => hint,
        }
    }
}

/// How to name a bag's source of speeds.
const SPEED_TOPIC: &str = "set topics.speed in the file beside the bag to its topic, or read it from CAN frames with [can]";

/// How to get speeds for a recording of this layout.
fn speeds_from(layout: DatasetKind) -> &'static str {
    match layout {
        DatasetKind::Folder => {
            "add speed.csv (time_s,speed_mps) beside the images to train; evaluation and prediction need no speeds"
        }
        DatasetKind::Video => {
            "add speed.csv (time_s,speed_mps) or a GPS track (.gpx, .nmea) beside the video to train; evaluation and prediction need no speeds"
        }
        DatasetKind::Comma2k19 => "fetch the segment's processed_log/CAN/speed",
        DatasetKind::KittiOdometry => {
            "train on sequences 00 to 10: speeds come from poses/<sequence>.txt, which KITTI publishes only for those; evaluation and \
             prediction need no speeds"
        }
        DatasetKind::Kitti360 => {
            "train on drives that have data_poses/<drive>/poses.txt and timestamps.txt, from which speeds come; evaluation and prediction \
             need no speeds"
        }
        DatasetKind::RgbD => {
            "train on a vehicle's recording; an RGB-D camera is carried by hand, so only evaluate and predict on its recordings"
        }
        DatasetKind::NuScenes => {
            "unpack the data set's metadata again: speeds come from ego_pose.json"
        }
        DatasetKind::KittiRaw => "fetch the drive's oxts folder: its speeds make depth metric",
        DatasetKind::Bag => SPEED_TOPIC,
        DatasetKind::Other => "give each frame its time and speed",
    }
}
