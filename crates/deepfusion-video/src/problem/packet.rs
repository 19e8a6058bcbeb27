//! Why a packet of a stream cannot be decoded.

use deepfusion_hint::{Hint, count_of};

/// Why a packet cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketProblem {
    /// The pictures' order differs from that of their packets.
    #[error("its picture is shown before that of an earlier message (a B-frame)")]
    Reordered,
    /// The beginning of the packet is incomplete.
    #[error("it is cut off within a slice's header")]
    Cut,
    /// The packet needs another one that is missing.
    #[error("an earlier message that its picture refers to is missing")]
    Gap,
    /// The packet is not a picture.
    #[error("it contains no picture")]
    Empty,
    /// The decoder gives no picture, and does not say why.
    #[error("it gives no picture")]
    NoPicture,
    /// The decoder gives no picture for the stream's first packet.
    #[error("it gives no picture: {message}")]
    NoFirstPicture {
        /// The decoder's message.
        message: String,
    },
    /// The decoder finds the packet damaged.
    #[error("it is damaged, or one before it is missing: {message}")]
    Damaged {
        /// The decoder's message.
        message: String,
    },
    /// The stream has fewer packets than when it was opened.
    #[error(
        "the stream ends here, {} {} counted when it was opened",
        count_of(*counted, "packet"),
        if *counted == 1 { "was" } else { "were" }
    )]
    Ended {
        /// The number counted at that time.
        counted: usize,
    },
}

impl Hint for PacketProblem {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Reordered => "encode without B-frames (libx264: -bf 0, or -tune zerolatency)",
            _ => {
                "cut the recording before that message, or at a key frame after it (with `rosbag filter`; messages are counted from 0), and use the parts"
            }
        };
        Some(text.to_owned())
    }
}
