//! A camera whose messages are packets of a video stream: `foxglove_msgs/CompressedVideo`, `ffmpeg_image_transport_msgs/FFMPEGPacket`, and
//! `sensor_msgs/CompressedImage` whose format is a codec's.
//!
//! A packet needs those before it, so that nothing can be read before the first key frame, and training, which reads in any order,
//! reads files: all frames are decoded once (`deepfusion_video::PacketFrames`).

use super::config::BagConfig;
use super::index::Index;
use crate::{Error, Result, decode_rgb, load_rgb};
use deepfusion_rosbag::msg::{
    CompressedImage, CompressedVideo, FfmpegPacket, OldFfmpegPacket, RosMessage,
};
use deepfusion_rosbag::{Message, MessageSource, Selection, Serialization};
use deepfusion_video::{Codec, PacketFrames, PacketStream};
use image::RgbImage;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The message types of video streams.
pub(super) const TYPES: [&str; 2] = [CompressedVideo::<'_>::TYPE, FfmpegPacket::<'_>::TYPE];

/// What of a stream's messages the pass over the bag has seen.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) topic: String,
    pub(super) codec: Codec,
    /// How many messages came before the first key frame.
    pub(super) before: u64,
    /// How many came from there on.
    pub(super) count: usize,
    /// Of each image, by time of measurement, which packet it is.
    pub(super) order: Vec<u64>,
}

impl Seen {
    /// Takes a message in: whether it is a frame's.
    pub(super) fn add(
        seen: &mut Option<Self>,
        topic: &str,
        (codec, packet): (Codec, &[u8]),
    ) -> bool {
        let seen = seen.get_or_insert_with(|| Self {
            topic: topic.to_owned(),
            codec,
            before: 0,
            count: 0,
            order: Vec::new(),
        });
        if seen.count == 0 && !codec.begins(packet) {
            seen.before += 1;
            return false;
        }
        seen.count += 1;
        true
    }

    /// What is left out, in a sentence.
    pub(super) fn warning(&self) -> Option<String> {
        let Self { topic, before, .. } = self;
        match before {
            0 => None,
            1 => Some(format!(
                "{topic}: the first message comes before the first key frame and cannot be decoded: it is left out"
            )),
            _ => Some(format!(
                "{topic}: the first {before} messages come before the first key frame and cannot be decoded: they are left out"
            )),
        }
    }
}

/// The packet of a message, and its codec; `None` where it is a picture by itself.
///
/// # Errors
/// [`Error::Bag`]; [`Error::Video`] for a codec that is not read.
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

/// Both layouts of a packet have one name; that of ROS 1's first version is recognised by its MD5, which ROS 2 has none of.
fn is_old(message: &Message<'_>) -> bool {
    message.serialization() == Serialization::Ros1 && message.is::<OldFfmpegPacket<'_>>()
}

/// The frames of a bag's video stream.
#[derive(Debug)]
pub(super) struct BagVideo {
    seen: Seen,
    frames: PacketFrames,
}

impl BagVideo {
    /// `None` where the images are none of a video.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(super) fn of(bag: &Path, index: &Index, config: &BagConfig) -> Result<Option<Self>> {
        let Some(seen) = index.video.clone() else {
            return Ok(None);
        };
        let stream = PacketStream {
            file: bag.to_owned(),
            name: seen.topic.clone(),
            codec: seen.codec,
            before: seen.before,
            count: seen.count,
        };
        let frames = PacketFrames::new(stream, &cache(bag, &seen.topic, config))?;
        Ok(Some(Self { seen, frames }))
    }

    /// The first frame, without decoding the others.
    ///
    /// # Errors
    /// [`Error::Program`] without ffmpeg, [`Error::Video`], [`Error::Bag`].
    pub(super) fn first(&self, bag: &dyn MessageSource) -> Result<RgbImage> {
        let mut packets = self.packets(bag)?;
        let first = packets.next().unwrap_or_else(|| Ok(Vec::new()))?;
        decode_rgb(&self.frames.first_picture(&first)?, bag.path())
    }

    /// An image by its number in order of time; `None` where there is no such image.
    ///
    /// # Errors
    /// As [`PacketFrames::frame`], and [`Error::Image`] for a file that was harmed since.
    pub(super) fn load(&self, bag: &dyn MessageSource, number: u64) -> Result<Option<RgbImage>> {
        let place = usize::try_from(number).ok();
        let Some(packet) = place.and_then(|n| self.seen.order.get(n)) else {
            return Ok(None);
        };
        let file = self.frames.frame(*packet, || self.packets(bag))?;
        load_rgb(&file).map(Some)
    }

    /// The packets from the first key frame on.
    fn packets<'b>(
        &self,
        bag: &'b dyn MessageSource,
    ) -> Result<impl Iterator<Item = Result<Vec<u8>>> + 'b> {
        let messages = bag.messages(Selection::topics([self.seen.topic.as_str()]))?;
        let packets = messages.map(|message| {
            let message = message?;
            let packet = packet(bag.path(), &message)?;
            Ok(packet.map_or(Vec::new(), |(_, data)| data.into_owned()))
        });
        // What could not be read there is no loss, either.
        let codec = self.seen.codec;
        Ok(packets.skip_while(move |packet| !matches!(packet, Ok(packet) if codec.begins(packet))))
    }
}

/// Where frames are kept: `<bag>.<topic>.frames`, beside the bag or where the file beside it says.
fn cache(bag: &Path, topic: &str, config: &BagConfig) -> PathBuf {
    let beside = bag.parent().unwrap_or(Path::new("."));
    let folder = config.cache.as_ref();
    let folder = folder.map_or(beside.to_owned(), |c| config.folder().join(c));
    let bag = bag.file_name().unwrap_or_default().to_string_lossy();
    // No topic has a dot in its name.
    let topic = topic.trim_matches('/').replace('/', ".");
    folder.join(format!("{bag}.{topic}.frames"))
}
