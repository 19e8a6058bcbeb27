//! The message types of a vehicle's recording, one file per package.
//!
//! Each type is declared once, as the list of its fields: the struct, its decoder and its encoder follow from that list
//! (`message!` in `wire`). MD5 and definition are those of the ROS packages, which the tests compare with another
//! implementation. Pixels and points are borrowed from the bag; everything else is owned.

mod ackermann_msgs;
mod bayer;
mod can_msgs;
mod cloud;
mod definition;
mod error;
mod ffmpeg_image_transport_msgs;
mod foxglove_msgs;
mod geometry_msgs;
mod image;
mod nav_msgs;
mod sensor_msgs;
mod std_msgs;
mod tf2_msgs;
pub(crate) mod wire;
mod yuv;

pub use ackermann_msgs::{AckermannDrive, AckermannDriveStamped};
pub use can_msgs::Frame;
pub use cloud::{Column, Datatype};
pub use error::{LayoutProblem, MessageError, MessagePart};
pub use ffmpeg_image_transport_msgs::{FfmpegPacket, OldFfmpegPacket};
pub use foxglove_msgs::CompressedVideo;
pub use geometry_msgs::{
    Point, Pose, PoseWithCovariance, Quaternion, Transform, TransformStamped, Twist, TwistStamped,
    TwistWithCovariance, TwistWithCovarianceStamped, Vector3,
};
pub use image::{BayerPattern, Encoding};
pub use nav_msgs::Odometry;
pub use sensor_msgs::{
    CameraInfo, CompressedImage, Image, Imu, NavSatFix, NavSatStatus, PointCloud2, PointField,
    RegionOfInterest,
};
pub use std_msgs::{Float32, Float64, Header};
pub use tf2_msgs::{OldTFMessage, TFMessage};

/// A message type.
pub trait RosMessage<'a>: Sized {
    /// Its name, such as `sensor_msgs/Imu`.
    const TYPE: &'static str;
    /// The MD5 of its definition, by which ROS tells versions of a type apart.
    const MD5: &'static str;
    /// Its fields, then those of every type it uses, as recorders write them.
    const DEFINITION: &'static str;

    /// Decodes a message's bytes (little-endian, without padding, strings and arrays after a u32 length).
    ///
    /// # Errors
    /// [`MessageError`] naming the field that does not fit, or giving the number of bytes left over.
    fn decode(bytes: &'a [u8]) -> Result<Self, MessageError>;

    /// Decodes a message's bytes as ROS 2 sends them: CDR of either byte order after four bytes of encapsulation.
    /// ROS 2 has no [`Header::seq`]; it is 0.
    ///
    /// # Errors
    /// As [`Self::decode`], and [`MessageError::Encapsulation`] for a representation other than plain CDR.
    fn decode_cdr(bytes: &'a [u8]) -> Result<Self, MessageError>;

    /// Appends the message's bytes to `out`.
    fn encode(&self, out: &mut Vec<u8>);
}
