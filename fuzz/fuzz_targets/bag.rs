//! A bag from any bytes, by its index and by scanning, every message decoded: never a panic, never much memory.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run bag fuzz/corpus/bag crates/deepfusion-rosbag/tests/reference -- -max_len=65536
#![no_main]

use deepfusion_rosbag::msg::{CameraInfo, Image, Imu, PointCloud2};
use deepfusion_rosbag::{Bag, BagOptions, Selection};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for ignore_index in [false, true] {
        let options = BagOptions {
            max_chunk_bytes: 1 << 20,
            threads: 0,
            ignore_index,
        };
        let Ok(bag) = Bag::from_bytes("fuzz.bag", bytes.to_vec(), options) else {
            continue;
        };
        let _ = bag.topics();
        let Ok(messages) = bag.messages(Selection::all()) else {
            continue;
        };
        // A few bytes of bzip2 are a mebibyte of messages.
        for message in messages.take(2000).flatten() {
            let _ = message.decode::<Imu>();
            let _ = message.decode::<CameraInfo>();
            let _ = message.decode::<Image>().map(|image| image.to_rgb8().is_ok());
            let _ = message.decode::<PointCloud2>().map(|cloud| cloud.points().is_ok());
        }
    }
});
