//! Packets of a video stream in a bag's messages.

use crate::{Error, IncompleteWarning, Result};
use deepfusion_rosbag::msg::{
    CompressedImage, CompressedVideo, FfmpegPacket, OldFfmpegPacket, RosMessage,
};
use deepfusion_rosbag::{Message, Serialization};
use deepfusion_video::Codec;
use std::borrow::Cow;
use std::path::Path;

/// The message types of video streams.
pub(super) const TYPES: [&str; 2] = [CompressedVideo::<'_>::TYPE, FfmpegPacket::<'_>::TYPE];

/// The stream's messages, as counted in the pass over the bag.
#[derive(Debug, Clone)]
pub(super) struct VideoTopic {
    pub(super) name: String,
    pub(super) codec: Codec,
    /// Number of messages before the first key frame.
    pub(super) before: u64,
    /// Number of messages from there on.
    pub(super) count: usize,
    /// Packet number of each image, ordered by time of measurement.
    pub(super) order: Vec<u64>,
}

impl VideoTopic {
    /// Adds a message; returns whether it is a frame.
    pub(super) fn add(
        found: &mut Option<Self>,
        topic: &str,
        (codec, packet): (Codec, &[u8]),
    ) -> bool {
        let found = found.get_or_insert_with(|| Self {
            name: topic.to_owned(),
            codec,
            before: 0,
            count: 0,
            order: Vec::new(),
        });
        if found.count == 0 && !codec.begins(packet) {
            found.before += 1;
            return false;
        }
        found.count += 1;
        true
    }

    /// The warning about messages that are left out.
    pub(super) fn warning(&self) -> Option<IncompleteWarning> {
        (self.before > 0).then(|| IncompleteWarning::BeforeKeyFrame {
            topic: self.name.clone(),
            messages: self.before,
        })
    }
}

/// The packet in a message, and its codec; `None` if the message is a single image.
///
/// # Errors
/// [`Error::Bag`]; [`Error::Video`] for an unsupported codec.
pub(super) fn packet<'m>(
    bag: &Path,
    message: &'m Message<'_>,
) -> Result<Option<(Codec, Cow<'m, [u8]>)>> {
    let (format, data) = if message.is::<CompressedVideo<'_>>() {
        let video: CompressedVideo<'_> = message.decode()?;
        (video.format, video.data)
    } else if is_old(message) {
        let old: OldFfmpegPacket<'_> = message.decode()?;
        (old.encoding, old.data)
    } else if message.connection().type_name == FfmpegPacket::TYPE {
        let packet: FfmpegPacket<'_> = message.decode()?;
        (packet.encoding, packet.data)
    } else if message.is::<CompressedImage<'_>>() {
        let image: CompressedImage<'_> = message.decode()?;
        return Ok(Codec::named(&image.format).map(|codec| (codec, image.data)));
    } else {
        return Ok(None);
    };
    match Codec::named(&format) {
        Some(codec) => Ok(Some((codec, data))),
        None => Err(Error::Video(deepfusion_video::Error::Codec {
            path: bag.to_owned(),
            stream: message.topic().to_owned(),
            format,
        })),
    }
}

/// Whether a packet has the layout of ROS 1's first version. Both layouts have the same name, so it is recognised by its MD5, which ROS 2
/// does not have.
fn is_old(message: &Message<'_>) -> bool {
    message.serialization() == Serialization::Ros1 && message.is::<OldFfmpegPacket<'_>>()
}
