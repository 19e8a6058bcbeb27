use super::definition::definition;
use super::wire::message;
use crate::Time;
use std::borrow::Cow;

message! {
    /// A frame of a compressed video, whose decoder needs the frames before it.
    CompressedVideo<'a> = "foxglove_msgs/CompressedVideo" "c5ea945275bc0729ed72f42e057a67bd" definition!(
        "time timestamp"
        "string frame_id"
        "uint8[] data"
        "string format";
    );
    /// Time of the image. The message has no header of `std_msgs`.
    timestamp: Time,
    /// The camera's optical frame.
    frame_id: String,
    /// The packet: Annex B of `h264` and `h265`, a frame of `vp9`, a temporal unit of `av1`.
    data: Cow<'a, [u8]>,
    /// `h264`, `h265`, `vp9` or `av1`.
    format: String,
}
