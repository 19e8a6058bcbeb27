//! A camera whose messages are packets of a video stream: `foxglove_msgs/CompressedVideo`, `ffmpeg_image_transport_msgs/FFMPEGPacket`, and
//! `sensor_msgs/CompressedImage` with a video codec as its format.
//!
//! Decoding a packet needs the previous ones, so nothing before the first key frame can be read. Since training reads frames in any
//! order, all of them are decoded to files once (`deepfusion_video::PacketFrames`).

use super::config::BagConfig;
use super::index::Index;
use super::packet::{VideoTopic, packet};
use crate::{Result, decode_rgb, load_rgb};
use deepfusion_rosbag::{MessageSource, Selection};
use deepfusion_video::{PacketFrames, PacketStream, frames_folder};
use image::RgbImage;
use std::path::{Path, PathBuf};

/// The frames of a bag's video stream.
#[derive(Debug)]
pub(super) struct BagVideo {
    topic: VideoTopic,
    frames: PacketFrames,
}

impl BagVideo {
    /// `None` if the images are not packets of a video.
    ///
    /// # Errors
    /// [`crate::Error::File`].
    pub(super) fn of(bag: &Path, index: &Index, config: &BagConfig) -> Result<Option<Self>> {
        let Some(topic) = index.video.clone() else {
            return Ok(None);
        };
        let stream = PacketStream {
            file: bag.to_owned(),
            name: topic.name.clone(),
            codec: topic.codec,
            before: topic.before,
            count: topic.count,
        };
        let frames = PacketFrames::new(stream, &cache(bag, &topic.name, config))?;
        Ok(Some(Self { topic, frames }))
    }

    /// The first frame, without decoding the others.
    ///
    /// # Errors
    /// [`crate::Error::Video`], also without ffmpeg, and [`crate::Error::Bag`].
    pub(super) fn first(&self, bag: &dyn MessageSource) -> Result<RgbImage> {
        let mut packets = self.packets(bag)?;
        let first = packets.next().unwrap_or_else(|| Ok(Vec::new()))?;
        Ok(decode_rgb(&self.frames.first_picture(&first)?, bag.path())?)
    }

    /// An image by its number in order of time; `None` if there is no such image.
    ///
    /// # Errors
    /// Those of [`PacketFrames::frame`], and [`crate::Error::Image`] for a decoded file that was damaged since.
    pub(super) fn load(&self, bag: &dyn MessageSource, number: u64) -> Result<Option<RgbImage>> {
        let place = usize::try_from(number).ok();
        let Some(packet) = place.and_then(|n| self.topic.order.get(n)) else {
            return Ok(None);
        };
        let file = self.frames.frame(*packet, || self.packets(bag))?;
        Ok(Some(load_rgb(&file)?))
    }

    /// The packets from the first key frame on.
    fn packets<'b>(
        &self,
        bag: &'b dyn MessageSource,
    ) -> Result<impl Iterator<Item = Result<Vec<u8>>> + 'b> {
        let messages = bag.messages(Selection::topics([self.topic.name.as_str()]))?;
        let packets = messages.map(|message| {
            let message = message?;
            let packet = packet(bag.path(), &message)?;
            Ok(packet.map_or(Vec::new(), |(_, data)| data.into_owned()))
        });
        // Unreadable messages before the first key frame do not matter either.
        let codec = self.topic.codec;
        Ok(packets.skip_while(move |packet| !matches!(packet, Ok(packet) if codec.begins(packet))))
    }
}

/// Path of the folder for decoded frames: `<bag>.<topic>.frames` beside the bag, or, with a hash of its path, in the cache folder of the
/// file beside it.
fn cache(bag: &Path, topic: &str, config: &BagConfig) -> PathBuf {
    let beside = bag.parent().unwrap_or(Path::new("."));
    let folder = config.cache.as_ref();
    let folder = folder.map_or(beside.to_owned(), |c| config.folder().join(c));
    let name = bag.file_name().unwrap_or_default().to_string_lossy();
    // Topic names cannot contain dots.
    let topic = topic.trim_matches('/').replace('/', ".");
    frames_folder(&folder, bag, &format!("{name}.{topic}"))
}
