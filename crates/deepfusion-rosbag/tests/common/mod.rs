//! Shared by several tests: messages as the lines that the reference scripts write.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]
#![allow(dead_code)]

use deepfusion_rosbag::msg::*;
use deepfusion_rosbag::{Message, Serialization, Time};
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

pub(crate) fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(name)
}

pub(crate) fn read_json<T: serde::de::DeserializeOwned>(name: &str) -> T {
    let text = std::fs::read_to_string(reference(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

pub(crate) fn sha256(bytes: impl AsRef<[u8]>) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// The 16 hexadecimal digits of a number's f64: exact, and NaN can be compared.
pub(crate) fn number(value: f64) -> String {
    format!("{:016x}", value.to_bits())
}

/// A value as lines `field = text`.
pub(crate) trait Lines {
    fn lines(&self, name: &str, out: &mut Vec<String>);
}

macro_rules! plain {
    ($($kind:ty),*) => {$(
        impl Lines for $kind {
            fn lines(&self, name: &str, out: &mut Vec<String>) {
                out.push(format!("{name} = {self}"));
            }
        }
    )*};
}
plain!(bool, u8, i8, u16, u32, i32, u64, String, Time);

impl Lines for f64 {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        out.push(format!("{name} = {}", number(*self)));
    }
}

impl Lines for f32 {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        f64::from(*self).lines(name, out);
    }
}

impl Lines for Cow<'_, [u8]> {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        out.push(format!("{name} = {}", sha256(self)));
    }
}

impl Lines for [u8; 8] {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        out.push(format!("{name} = {}", sha256(self)));
    }
}

fn floats(values: &[f64], name: &str, out: &mut Vec<String>) {
    if values.len() > 4 {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        out.push(format!("{name} = {}", sha256(bytes)));
        return;
    }
    for (i, value) in values.iter().enumerate() {
        value.lines(&format!("{name}[{i}]"), out);
    }
}

impl<const N: usize> Lines for [f64; N] {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        floats(self, name, out);
    }
}

impl Lines for Vec<f64> {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        floats(self, name, out);
    }
}

impl Lines for Vec<TransformStamped> {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        for (i, transform) in self.iter().enumerate() {
            transform.lines(&format!("{name}[{i}]"), out);
        }
    }
}

impl Lines for Vec<PointField> {
    fn lines(&self, name: &str, out: &mut Vec<String>) {
        for (i, field) in self.iter().enumerate() {
            field.lines(&format!("{name}[{i}]"), out);
        }
    }
}

macro_rules! fields {
    ($($kind:ty: $($field:ident $(as $label:literal)?),*;)*) => {$(
        impl Lines for $kind {
            fn lines(&self, name: &str, out: &mut Vec<String>) {
                let dot = if name.is_empty() { "" } else { "." };
                $({
                    let label = [$($label,)? stringify!($field)][0];
                    self.$field.lines(&format!("{name}{dot}{label}"), out);
                })*
            }
        }
    )*};
}

fields! {
    CompressedVideo<'_>: timestamp, frame_id, data, format;
    FfmpegPacket<'_>: header, width, height, encoding, pts, flags, is_bigendian, data;
    OldFfmpegPacket<'_>: header, data, img_width, img_height, encoding, pts, flags;
    Header: seq, stamp, frame_id;
    Float32: data;
    Float64: data;
    Vector3: x, y, z;
    Point: x, y, z;
    Quaternion: x, y, z, w;
    Pose: position, orientation;
    PoseWithCovariance: pose, covariance;
    Twist: linear, angular;
    TwistWithCovariance: twist, covariance;
    TwistStamped: header, twist;
    TwistWithCovarianceStamped: header, twist;
    Transform: translation, rotation;
    TransformStamped: header, child_frame_id, transform;
    TFMessage: transforms;
    OldTFMessage: transforms;
    Odometry: header, child_frame_id, pose, twist;
    AckermannDrive: steering_angle, steering_angle_velocity, speed, acceleration, jerk;
    AckermannDriveStamped: header, drive;
    Frame: header, id, is_rtr, is_extended, is_error, dlc, data;
    Image<'_>: header, height, width, encoding, is_bigendian, step, data;
    CompressedImage<'_>: header, format, data;
    RegionOfInterest: x_offset, y_offset, height, width, do_rectify;
    CameraInfo: header, height, width, distortion_model, d as "D", k as "K", r as "R", p as "P", binning_x, binning_y,
        roi;
    PointField: name, offset, datatype, count;
    PointCloud2<'_>: header, height, width, fields, is_bigendian, point_step, row_step, data, is_dense;
    Imu: header, orientation, orientation_covariance, angular_velocity, angular_velocity_covariance,
        linear_acceleration, linear_acceleration_covariance;
    NavSatStatus: status, service;
    NavSatFix: header, status, latitude, longitude, altitude, position_covariance, position_covariance_type;
}

fn typed<'m, T: RosMessage<'m> + Lines>(message: &'m Message<'_>) -> Vec<String> {
    let value: T = message.decode().unwrap();
    if message.serialization() == Serialization::Ros1 {
        let mut again = Vec::new();
        value.encode(&mut again);
        assert_eq!(again, message.data(), "{message:?} encodes to other bytes");
    }
    lines_of(&value)
}

/// A message's values.
pub(crate) fn lines_of(value: &impl Lines) -> Vec<String> {
    let mut lines = Vec::new();
    value.lines("", &mut lines);
    lines
}

/// The message's values as its own type, after checking that they encode to the same bytes; none for an unknown
/// type.
pub(crate) fn lines(message: &Message<'_>) -> Vec<String> {
    match message.connection().type_name.as_str() {
        Float32::TYPE => typed::<Float32>(message),
        Float64::TYPE => typed::<Float64>(message),
        Image::TYPE => typed::<Image>(message),
        CompressedImage::TYPE => typed::<CompressedImage>(message),
        CameraInfo::TYPE => typed::<CameraInfo>(message),
        PointCloud2::TYPE => typed::<PointCloud2>(message),
        Imu::TYPE => typed::<Imu>(message),
        NavSatFix::TYPE => typed::<NavSatFix>(message),
        TwistStamped::TYPE => typed::<TwistStamped>(message),
        Odometry::TYPE => typed::<Odometry>(message),
        AckermannDriveStamped::TYPE => typed::<AckermannDriveStamped>(message),
        Frame::TYPE => typed::<Frame>(message),
        _ => Vec::new(),
    }
}

/// A folder of real bags: `rosbag` below `DEEPFUSION_DATA`, or `../shared/data` beside the workspace. If it is missing, prints so and
/// returns `None`.
pub(crate) fn real_bags() -> Option<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = std::env::var_os("DEEPFUSION_DATA")
        .map_or_else(|| workspace.join("../shared/data"), PathBuf::from);
    let path = root.join("rosbag");
    if path.exists() {
        return Some(path);
    }
    eprintln!(
        "skipped: no folder {} (set DEEPFUSION_DATA)",
        path.display()
    );
    None
}
