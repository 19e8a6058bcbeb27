//! Why a packet of a stream cannot be decoded.

use deepfusion_hint::{Hint, count_of};

/// Why a packet cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketProblem {
    /// Pictures come in another order than their packets.
    #[error("its picture is shown before that of an earlier message (a B-frame)")]
    Reordered,
    /// Its beginning is not whole.
    #[error("it is cut off within a slice's header")]
    Cut,
    /// It needs one that is not there.
    #[error("a message before it is missing, which its picture refers to")]
    Gap,
    /// It is something else than a picture.
    #[error("it holds no picture")]
    Empty,
    /// The decoder makes nothing of it, and does not say why.
    #[error("it gives no picture")]
    NoPicture,
    /// The decoder makes nothing of the stream's first packet.
    #[error("it gives no picture: {said}")]
    NoFirstPicture {
        /// What the decoder said.
        said: String,
    },
    /// The decoder finds it damaged.
    #[error("it is damaged, or one before it is missing: {said}")]
    Damaged {
        /// What the decoder said.
        said: String,
    },
    /// The stream has fewer packets than when it was opened.
    #[error(
        "the stream ends here, {} {} counted when it was opened",
        count_of(*counted, "packet"),
        if *counted == 1 { "was" } else { "were" }
    )]
    Ended {
        /// How many there were.
        counted: usize,
    },
}

impl Hint for PacketProblem {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Reordered => "encode without B-frames (libx264: -bf 0, or -tune zerolatency)",
            _ => {
                "cut the recording before that message, or after it at a key frame (`rosbag filter`; messages are counted from 0), and use the parts"
            }
        };
        Some(text.to_owned())
    }
}
