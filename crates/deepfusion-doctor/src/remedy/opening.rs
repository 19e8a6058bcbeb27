//! What to do about what cannot be read, or is taken for granted.

use std::fmt;

/// What to do about what cannot be read, or is taken for granted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OpeningRemedy {
    /// What cannot be opened.
    Correct,
    /// An image that cannot be read.
    CopyOrLeaveOut,
    /// A drive without pairs of frames to learn from.
    KnownMotion,
    /// Nothing that says how the vehicle turned.
    RecordTurns,
    /// A damaged bag.
    RepairBag,
    /// Recordings beside the drives that are read.
    OwnPath,
    /// What was taken for granted.
    SayOtherwise,
}

impl fmt::Display for OpeningRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Correct => "correct what the message names",
            Self::CopyOrLeaveOut => "copy the recording again, or leave the frame out",
            Self::KnownMotion => "training needs pairs of frames with a known motion",
            Self::RecordTurns => "record an inertial unit or the steering angle",
            Self::RepairBag => "copy the bag again; `rosbag reindex` (`ros2 bag reindex`) repairs one whose recording was cut off",
            Self::OwnPath => "give what is to be read as well by its own path",
            Self::SayOtherwise => "see that it is so, or say otherwise in the file beside the recording",
        })
    }
}
