//! Why an image cannot be read.

use deepfusion_rosbag::Time;
use image::ImageError;

/// Why an image cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageProblem {
    /// The image file cannot be read.
    #[error(transparent)]
    File(#[from] deepfusion_images::ImageProblem),
    /// The image cannot be encoded in another format.
    #[error("{0}")]
    Unencodable(#[source] ImageError),
    /// The file is an image, but not a depth image.
    #[error("not a depth image: expected a 16-bit grey PNG")]
    NotDepth,
    /// The recording has no image with this number.
    #[error("no image {0}")]
    NoImage(u64),
    /// A message is no longer where it was in the bag.
    #[error("{topic}: no message at {time}")]
    NoMessage {
        /// Name of its topic.
        topic: String,
        /// Time at which it was recorded.
        time: Time,
    },
    /// A message has fewer pixels than its width and height require.
    #[error("{topic} at {time}: fewer pixels than its width and height require")]
    TooFewPixels {
        /// Name of its topic.
        topic: String,
        /// Time at which it was recorded.
        time: Time,
    },
    /// The topic has both single images and packets of a video.
    #[error("{topic}: some of its messages are single images, others packets of a video")]
    Mixed {
        /// Name of the topic.
        topic: String,
    },
}
