//! An MCAP file from any bytes, behind its magic, every message read: never a panic, never much memory.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run mcap fuzz/corpus/mcap crates/deepfusion-ros2bag/tests/reference -- -max_len=65536
#![no_main]

use deepfusion_ros2bag::Ros2Bag;
use deepfusion_rosbag::{MessageSource, Selection};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static FILE: LazyLock<PathBuf> =
    LazyLock::new(|| deepfusion_fuzz::scratch("mcap").join("drive.mcap"));

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("a scratch file");
    let Ok(bag) = Ros2Bag::open(&*FILE) else {
        return;
    };
    let _ = (bag.damage(), bag.topics(), bag.time_range());
    let Ok(messages) = bag.messages(Selection::all()) else {
        return;
    };
    let mut last = None;
    for message in messages.take(2000).flatten() {
        assert!(last.is_none_or(|last| last <= message.time()), "time order");
        last = Some(message.time());
        let _ = (message.header_stamp(), message.data().len());
    }
});
