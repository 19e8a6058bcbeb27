//! Why a recording has no frames, or no motion.

use crate::DatasetKind;
use deepfusion_hint::count_of;
use std::borrow::Cow;

/// Why a recording that has streams has no images.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoFramesReason {
    /// The folder has no picture.
    #[error("no image (.png, .jpg, .jpeg)")]
    NoPicture,
    /// The RGB-D folder has no colour image.
    #[error("no frame-<number>.color.png or .jpg")]
    NoColour,
    /// None of the files that the tables name is there.
    #[error("not there, and no other image of {camera} that {table} names in {}", count_of(*scenes, "scene"))]
    NotUnpacked {
        /// The camera.
        camera: &'static str,
        /// The table.
        table: &'static str,
        /// How many scenes it has.
        scenes: usize,
    },
    /// Nothing that a video's decoding could begin with was recorded.
    #[error(
        "{topic} has {} and no key frame among them, with the parameters that decoding begins with",
        count_of(*messages, "message")
    )]
    NoKeyFrame {
        /// The topic.
        topic: String,
        /// How many messages it has.
        messages: u64,
    },
    /// No topic holds images.
    #[error("none of its topics holds images: {}", topics.join(", "))]
    NoImageTopic {
        /// The topics that there are.
        topics: Vec<String>,
    },
}

impl NoFramesReason {
    pub(super) fn hint(&self) -> &'static str {
        match self {
            Self::NoPicture => "name the folder of the images in dataset.toml: images = \"…\"",
            Self::NoColour => "fetch the sequence's images",
            Self::NotUnpacked { .. } => "unpack samples and sweeps beside the folder of the tables",
            Self::NoKeyFrame { .. } => {
                "record for longer than from one key frame of the encoder to the next, or have it write them more often"
            }
            Self::NoImageTopic { .. } => {
                "topics.image in the file beside the bag names the camera's topic"
            }
        }
    }
}

/// Why there is no ego-motion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoTrackReason {
    /// Nothing measured speeds.
    #[error("it has no speeds")]
    NoSpeeds {
        /// The recording's layout, which says where speeds come from.
        layout: DatasetKind,
    },
    /// Poses would give speeds, but have no times.
    #[error("it has no speeds")]
    UntimedPoses,
    /// Speeds are there, but the frames have no times.
    #[error("nothing says when its frames were taken")]
    NoTimes,
    /// No topic of a bag's holds speeds.
    #[error(
        "the bag has no speed of the vehicle (TwistStamped, TwistWithCovarianceStamped, Odometry, AckermannDriveStamped, NavSatFix, a \
         CAN signal)"
    )]
    NoSpeedTopic,
    /// What the layout of another crate says ([`crate::Recording`] is open).
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
                "speeds come from poses and times.txt: put the sequence's times there (data_odometry_calib.zip)"
            }
            Self::NoTimes => "add frames.csv, timestamps.txt or fps in dataset.toml",
            Self::NoSpeedTopic => SPEED_TOPIC,
            Self::Other { hint, .. } => hint,
        }
    }
}

/// Where a bag's speeds come from.
const SPEED_TOPIC: &str =
    "topics.speed in the file beside the bag names its topic; [can] reads it from CAN frames";

/// Where a layout's speeds come from.
fn speeds_from(layout: DatasetKind) -> &'static str {
    match layout {
        DatasetKind::Folder => {
            "training needs speed.csv (time_s,speed_mps) beside the images; evaluation and prediction do not"
        }
        DatasetKind::Video => {
            "training needs speed.csv (time_s,speed_mps) or a GPS track (.gpx, .nmea) beside the video; evaluation and prediction do not"
        }
        DatasetKind::Comma2k19 => "fetch processed_log/CAN/speed of the segment",
        DatasetKind::KittiOdometry => {
            "speeds come from poses/<sequence>.txt, which KITTI publishes of sequences 00 to 10: train on those; \
             evaluation and prediction need none"
        }
        DatasetKind::Kitti360 => {
            "speeds come from data_poses/<drive>/poses.txt and timestamps.txt: train on drives that have them; \
             evaluation and prediction need none"
        }
        DatasetKind::RgbD => {
            "an RGB-D camera is carried by hand: evaluate and predict on it, train on a vehicle's recording"
        }
        DatasetKind::NuScenes => {
            "speeds come from ego_pose.json: unpack the data set's metadata again"
        }
        DatasetKind::KittiRaw => {
            "fetch the drive's oxts folder: its speeds are what makes depth metric"
        }
        DatasetKind::Bag => SPEED_TOPIC,
        DatasetKind::Other => "give each frame its time and speed",
    }
}
