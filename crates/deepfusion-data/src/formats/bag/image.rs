//! An image message as pixels.

use super::index::MessageRef;
use crate::{Error, ImageProblem, Result, decode_rgb};
use deepfusion_rosbag::msg::{CompressedImage, Image, RosMessage};
use deepfusion_rosbag::{Message, MessageSource, Selection, Time};
use image::RgbImage;

/// The message of a topic recorded at a place's time.
///
/// # Errors
/// [`Error::Bag`]; [`Error::Image`] where it is no longer there.
pub(super) fn message<'bag>(
    bag: &'bag dyn MessageSource,
    topic: &str,
    place: &MessageRef,
) -> Result<Message<'bag>> {
    let after = Time::from_nanos(place.recorded.nanos() + 1);
    let selection = Selection::topics([topic]).from(place.recorded).until(after);
    let mut last = None;
    for message in bag.messages_on_demand(selection)? {
        let message = message?;
        // Two messages can be recorded in one nanosecond: the stamp tells them apart.
        if super::index::stamp(&message) == place.stamp_ns {
            return Ok(message);
        }
        last = Some(message);
    }
    last.ok_or_else(|| Error::Image {
        path: bag.path().to_owned(),
        problem: ImageProblem::NoMessage {
            topic: topic.to_owned(),
            time: place.recorded,
        },
    })
}

/// The pixels of an image message as 8-bit RGB.
///
/// # Errors
/// [`Error::Bag`] for an encoding that is no picture, or sizes that contradict each other; [`Error::Image`].
pub(super) fn decode(bag: &dyn MessageSource, message: &Message<'_>) -> Result<RgbImage> {
    if message.is::<CompressedImage<'_>>() {
        let image: CompressedImage<'_> = message.decode()?;
        return Ok(decode_rgb(&image.data, bag.path())?);
    }
    let image: Image<'_> = message.decode()?;
    // As a message of the bag's, whose hint says what is read: an image file's would say PNG and JPEG.
    let pixels = image
        .to_rgb8()
        .map_err(|source| deepfusion_rosbag::Error::Message {
            path: bag.path().to_owned(),
            topic: message.topic().to_owned(),
            time: message.time(),
            type_name: Image::TYPE,
            source: Box::new(source),
        })?;
    RgbImage::from_raw(image.width, image.height, pixels).ok_or_else(|| Error::Image {
        path: bag.path().to_owned(),
        problem: ImageProblem::TooFewPixels {
            topic: message.topic().to_owned(),
            time: message.time(),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;
    use deepfusion_rosbag::msg::Header;
    use deepfusion_rosbag::{Bag, BagWriter, WriterOptions};
    use std::borrow::Cow;

    /// The picture of a bag with one image of 2 × 2 pixels.
    fn picture(encoding: &str) -> Result<RgbImage> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.bag");
        let mut writer = BagWriter::create(&path, WriterOptions::default()).unwrap();
        let connection = writer.add_connection::<Image<'_>>("/camera").unwrap();
        let image = Image {
            header: Header::default(),
            height: 2,
            width: 2,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step: 8,
            data: Cow::Owned(vec![128; 16]),
        };
        let time = Time::from_nanos(1);
        writer.write(connection, time, &image).unwrap();
        writer.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        let mut messages = bag.messages_on_demand(Selection::all()).unwrap();
        decode(&bag, &messages.next().unwrap().unwrap())
    }

    #[test]
    fn bayer_patterns_yuv_and_sixteen_bits_are_pictures() {
        for encoding in ["bayer_grbg8", "mono16", "mono8"] {
            let grey = picture(encoding).unwrap();
            assert_eq!(grey.as_raw(), &[128; 12], "{encoding}");
        }
        // 1.164 (128 - 16).
        assert_eq!(picture("yuv422").unwrap().as_raw(), &[130; 12]);
    }

    #[test]
    fn the_hint_of_an_encoding_that_is_not_read_lists_those_that_are() {
        let error = picture("nv12").unwrap_err();
        let text = error.to_string();
        assert!(text.contains("/camera") && text.contains("nv12"), "{text}");
        let hint = error.hint().unwrap();
        assert!(
            hint.contains("bayer_rggb8") && hint.contains("yuv422_yuy2"),
            "{hint}"
        );
        assert!(!hint.contains("PNG"), "{hint}");
    }
}
