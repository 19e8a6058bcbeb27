//! A cloud from any bytes, every column of it read: as many numbers as there are points, and never a panic.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run pointcloud2
#![no_main]

use deepfusion_rosbag::RosMessage;
use deepfusion_rosbag::msg::PointCloud2;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(cloud) = PointCloud2::decode(bytes) else {
        return;
    };
    let mut again = Vec::new();
    cloud.encode(&mut again);
    for field in cloud.fields.iter().take(8) {
        for element in [0, field.count.saturating_sub(1)] {
            if let Ok(column) = cloud.column_at(&field.name, element) {
                assert_eq!(Ok(column.len()), cloud.points());
                assert_eq!(column.f64s().count(), column.len());
            }
        }
    }
});
