//! Why an image cannot be read.

use deepfusion_rosbag::Time;
use image::ImageError;

/// Why an image cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageProblem {
    /// Its file.
    #[error(transparent)]
    File(#[from] deepfusion_images::ImageProblem),
    /// It cannot be written in another format.
    #[error("{0}")]
    Unencodable(#[source] ImageError),
    /// A picture where a recording's depth should be.
    #[error("not a 16-bit grey PNG, which depth images are")]
    NotDepth,
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
