//! Why an image cannot be read.

use deepfusion_rosbag::Time;
use image::ImageError;

/// Why an image cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageProblem {
    /// It ends early.
    #[error("the image is truncated: the file ends within it")]
    Truncated,
    /// It is of another kind.
    #[error("neither a PNG nor a JPEG")]
    OtherFormat,
    /// A JPEG that does not say its size.
    #[error("the JPEG has no frame header")]
    NoFrameHeader,
    /// Its content is damaged.
    #[error("cannot be decoded: {0}")]
    Undecodable(#[source] ImageError),
    /// It cannot be written in another format.
    #[error("{0}")]
    Unencodable(#[source] ImageError),
    /// A picture where a recording's depth should be.
    #[error("not a 16-bit grey PNG, which depth images are")]
    NotDepth,
    /// A picture where KITTI's annotated depth should be.
    #[error("not a 16-bit grey PNG, which depth in steps of 1/256 m needs")]
    NotAnnotatedDepth,
    /// A recording has no image of this number.
    #[error("there is no image {0}")]
    NoImage(u64),
    /// A message is no longer where it was.
    #[error("{topic}: no message at {time}")]
    NoMessage {
        /// Its topic.
        topic: String,
        /// When it was recorded.
        time: Time,
    },
    /// A message holds fewer pixels than its size says.
    #[error("{topic} at {time}: its pixels do not fill its size")]
    TooFewPixels {
        /// Its topic.
        topic: String,
        /// When it was recorded.
        time: Time,
    },
    /// A topic of pictures and of a video's packets.
    #[error("{topic}: some of its messages are pictures, others packets of a video")]
    Mixed {
        /// The topic.
        topic: String,
    },
}
