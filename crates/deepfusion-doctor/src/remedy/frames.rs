//! What to do about when frames were taken, and about a vehicle that stands.

use std::fmt;

/// What to do about when frames were taken, and about a vehicle that stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FramesRemedy {
    /// Frames that go back in time.
    SortFrames,
    /// Frames that are missing.
    FindLostFrames,
    /// A motion that is not known at times.
    FindLostSpeeds,
    /// Frames that are the frame before once more.
    RemoveRepeated,
    /// A vehicle that stands.
    CutStanding,
}

impl fmt::Display for FramesRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SortFrames => "sort the frames by time, or correct the time stamps",
            Self::FindLostFrames => "find out where the recorder drops frames (disk, network, queue length), or cut the recording there",
            Self::FindLostSpeeds => "find out where the recorder drops messages of the speed, or cut the recording there",
            Self::RemoveRepeated => "record at the camera's own rate, and remove the repeated frames (time stamps and all)",
            Self::CutStanding => "cut the standing parts out, or see whether the speed signal drops out",
        })
    }
}
