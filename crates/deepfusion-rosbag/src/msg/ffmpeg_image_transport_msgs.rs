use super::definition::{definition, header, part};
use super::std_msgs::Header;
use super::wire::message;
use std::borrow::Cow;

message! {
    /// A packet of an encoder of libav, as the image transport `ffmpeg` sends it.
    FfmpegPacket<'a> = "ffmpeg_image_transport_msgs/FFMPEGPacket" "4c1b25efca82fe4dd7addd520d7cc4b9" definition!(
        "std_msgs/Header header"
        "int32 width"
        "int32 height"
        "string encoding"
        "uint64 pts"
        "uint8 flags"
        "bool is_bigendian"
        "uint8[] data";
        header!()
    );
    /// Time of the image, and the camera's optical frame.
    header: Header,
    /// Columns of the image.
    width: i32,
    /// Rows of the image.
    height: i32,
    /// The codec (`h264`, `hevc`; in older versions the encoder, `libx264`), followed by pixel formats, separated by semicolons.
    encoding: String,
    /// The encoder's time stamp.
    pts: u64,
    /// The encoder's flags: 1 is a key frame.
    flags: u8,
    /// Whether the encoding machine is big-endian.
    is_bigendian: bool,
    /// The packet.
    data: Cow<'a, [u8]>,
}

message! {
    /// The same message in the layout of the first version of the transport, for ROS 1.
    OldFfmpegPacket<'a> = "ffmpeg_image_transport_msgs/FFMPEGPacket" "dedcac975af2f047308b4b7449e5c259" definition!(
        "std_msgs/Header header"
        "uint8[] data"
        "int32 img_width"
        "int32 img_height"
        "string encoding"
        "uint64 pts"
        "uint8 flags";
        header!()
    );
    /// Time of the image, and the camera's optical frame.
    header: Header,
    /// The packet.
    data: Cow<'a, [u8]>,
    /// Columns of the image.
    img_width: i32,
    /// Rows of the image.
    img_height: i32,
    /// The encoder: `libx264`, `hevc_nvenc`.
    encoding: String,
    /// The encoder's time stamp.
    pts: u64,
    /// The encoder's flags: 1 is a key frame.
    flags: u8,
}
