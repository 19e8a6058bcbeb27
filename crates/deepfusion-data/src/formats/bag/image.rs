//! Decodes image messages.

use super::index::MessageRef;
use crate::{Error, ImageProblem, Result};
use deepfusion_images::decode_bytes;
use deepfusion_rosbag::msg::{CompressedImage, Encoding, Image, RosMessage};
use deepfusion_rosbag::{Message, MessageSource, Selection, Time};
use image::{DynamicImage, RgbImage};
use std::borrow::Cow;

/// The topic's message that was recorded at the time of `place`.
///
/// # Errors
/// [`Error::Bag`]; [`Error::Image`] if it no longer exists.
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
        // Two messages can be recorded in the same nanosecond; their stamps differ.
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
/// [`Error::Bag`] for an unsupported encoding, or sizes that contradict each other; [`Error::Image`].
pub(super) fn decode(bag: &dyn MessageSource, message: &Message<'_>) -> Result<RgbImage> {
    if message.is::<CompressedImage<'_>>() {
        let compressed: CompressedImage<'_> = message.decode()?;
        let picture = decode_bytes(&compressed.data, bag.path())?;
        return match (mosaic(&compressed.format), picture) {
            (Some(encoding), DynamicImage::ImageLuma8(grey)) => {
                let (width, height) = grey.dimensions();
                let image = Image {
                    header: compressed.header,
                    height,
                    width,
                    encoding,
                    is_bigendian: 0,
                    step: width,
                    data: Cow::Owned(grey.into_raw()),
                };
                rgb(bag, message, &image)
            }
            (_, picture) => Ok(picture.into_rgb8()),
        };
    }
    let image: Image<'_> = message.decode()?;
    rgb(bag, message, &image)
}

/// The Bayer pattern of an image that was compressed without demosaicing, according to the message's format: ROS 1 then writes
/// `bayer_rggb8; jpeg compressed `, but with `bgr8` at the end if the image was demosaiced first.
fn mosaic(format: &str) -> Option<String> {
    let (encoding, rest) = format.split_once(';')?;
    let (_, compressed_as) = rest.split_once("compressed")?;
    let encoding = encoding.trim();
    let is_bayer = matches!(Encoding::from_name(encoding), Some(Encoding::Bayer8(_)));
    (is_bayer && compressed_as.trim().is_empty()).then(|| encoding.to_owned())
}

/// The RGB pixels of an image from `message`.
fn rgb(bag: &dyn MessageSource, message: &Message<'_>, image: &Image<'_>) -> Result<RgbImage> {
    // Report errors as those of a message, whose hint lists the supported encodings; an image file's hint would list PNG and JPEG.
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
    use std::io::Cursor;

    /// The decoded image of a bag with one message.
    fn decoded<'m, M: RosMessage<'m>>(image: &M) -> Result<RgbImage> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.bag");
        let mut writer = BagWriter::create(&path, WriterOptions::default()).unwrap();
        let connection = writer.add_connection::<M>("/camera").unwrap();
        let time = Time::from_nanos(1);
        writer.write(connection, time, image).unwrap();
        writer.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        let mut messages = bag.messages_on_demand(Selection::all()).unwrap();
        decode(&bag, &messages.next().unwrap().unwrap())
    }

    /// The decoded image of a message with 2 × 2 pixels.
    fn picture(encoding: &str) -> Result<RgbImage> {
        decoded(&Image {
            header: Header::default(),
            height: 2,
            width: 2,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step: 8,
            data: Cow::Owned(vec![128; 16]),
        })
    }

    /// A Bayer mosaic of a uniform colour, stored as a grey image of 4 × 4 pixels.
    fn of_format(format: &str) -> RgbImage {
        let filter = [[200, 90], [90, 7]];
        let grey = image::GrayImage::from_fn(4, 4, |x, y| {
            image::Luma([filter[y as usize % 2][x as usize % 2]])
        });
        let mut file = Vec::new();
        grey.write_to(&mut Cursor::new(&mut file), image::ImageFormat::Png)
            .unwrap();
        let compressed = CompressedImage {
            header: Header::default(),
            format: format.to_owned(),
            data: Cow::Owned(file),
        };
        decoded(&compressed).unwrap()
    }

    #[test]
    fn compressed_bayer_images_are_demosaiced() {
        let colour = [200_u8, 90, 7].repeat(16);
        assert_eq!(of_format("bayer_rggb8; jpeg compressed ").as_raw(), &colour);
        assert_eq!(of_format("bayer_rggb8; png compressed").as_raw(), &colour);
        // Grey images, whatever the camera's original encoding.
        for format in [
            "jpeg",
            "mono8; jpeg compressed ",
            "bayer_rggb8; jpeg compressed mono8",
            "bayer_rggb16; png compressed ",
            "bayer_rggb8",
        ] {
            let grey = of_format(format);
            assert_eq!(grey.get_pixel(0, 0).0, [200; 3], "{format}");
        }
    }

    #[test]
    fn bayer_yuv_and_sixteen_bit_images_are_decoded() {
        for encoding in ["bayer_grbg8", "mono16", "mono8"] {
            let grey = picture(encoding).unwrap();
            assert_eq!(grey.as_raw(), &[128; 12], "{encoding}");
        }
        // 1.164 (128 - 16).
        assert_eq!(picture("yuv422").unwrap().as_raw(), &[130; 12]);
    }

    #[test]
    fn the_hint_about_an_unsupported_encoding_lists_the_supported_ones() {
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
