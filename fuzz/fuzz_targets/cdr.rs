//! Each message type from any bytes as CDR: never a panic, never more memory than there are bytes for.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run cdr
#![no_main]

use deepfusion_rosbag::RosMessage;
use deepfusion_rosbag::msg::{
    AckermannDriveStamped, CameraInfo, CompressedImage, Float32, Float64, Frame, Image, Imu, NavSatFix, Odometry,
    PointCloud2, TFMessage, TwistStamped, TwistWithCovarianceStamped,
};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = AckermannDriveStamped::decode_cdr(bytes);
    let _ = CameraInfo::decode_cdr(bytes);
    let _ = CompressedImage::decode_cdr(bytes);
    let _ = (Float32::decode_cdr(bytes), Float64::decode_cdr(bytes));
    let _ = Frame::decode_cdr(bytes);
    let _ = Image::decode_cdr(bytes).map(|image| image.to_rgb8().is_ok());
    let _ = (Imu::decode_cdr(bytes), NavSatFix::decode_cdr(bytes));
    let _ = (Odometry::decode_cdr(bytes), TwistStamped::decode_cdr(bytes));
    let _ = (TFMessage::decode_cdr(bytes), TwistWithCovarianceStamped::decode_cdr(bytes));
    if let Ok(cloud) = PointCloud2::decode_cdr(bytes) {
        for field in cloud.fields.iter().take(8) {
            if let Ok(column) = cloud.column(&field.name) {
                assert_eq!(column.f64s().count(), column.len());
            }
        }
    }
});
