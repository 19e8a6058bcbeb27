//! An image message as pixels.

use super::index::Place;
use crate::{Error, Result, decode_rgb};
use deepfusion_rosbag::msg::{CompressedImage, Image};
use deepfusion_rosbag::{Message, MessageSource, Selection, Time};
use image::RgbImage;

/// The message of a topic recorded at a place's time.
///
/// # Errors
/// [`Error::Bag`]; [`Error::Image`] where it is no longer there.
pub(super) fn message<'bag>(
    bag: &'bag dyn MessageSource,
    topic: &str,
    place: &Place,
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
        problem: format!("{topic}: no message at {}", place.recorded),
        truncated: false,
    })
}

/// The pixels of an image message as 8-bit RGB.
///
/// # Errors
/// [`Error::Bag`] for an encoding that is no colour or grey picture; [`Error::Image`].
pub(super) fn decode(bag: &dyn MessageSource, message: &Message<'_>) -> Result<RgbImage> {
    if message.is::<CompressedImage<'_>>() {
        let image: CompressedImage<'_> = message.decode()?;
        return decode_rgb(&image.data, bag.path());
    }
    let image: Image<'_> = message.decode()?;
    let bad = |problem: String| Error::Image {
        path: bag.path().to_owned(),
        problem: format!("{} at {}: {problem}", message.topic(), message.time()),
        truncated: false,
    };
    let pixels = image.to_rgb8().map_err(|e| bad(e.to_string()))?;
    RgbImage::from_raw(image.width, image.height, pixels)
        .ok_or_else(|| bad("its pixels do not fill its size".into()))
}
