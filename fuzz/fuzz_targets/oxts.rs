//! Any bytes as an OXTS packet and as the packets' time stamps: never a panic, and what is read is finite.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run oxts
#![no_main]

use deepfusion_data::kitti::{OxtsPacket, TimeStamps, read_oxts};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = deepfusion_fuzz::scratch("oxts");
    std::fs::create_dir_all(folder.join("data")).expect("a folder of packets");
    folder
});

fuzz_target!(|bytes: &[u8]| {
    let packet = FOLDER.join("data/0000000000.txt");
    std::fs::write(&packet, bytes).expect("a scratch file");
    if let Ok(packet) = OxtsPacket::read(&packet) {
        let all = [packet.attitude_rad, packet.velocity_mps, packet.acceleration_mps2, packet.rate_radps];
        assert!(all.iter().flatten().all(|x| x.is_finite()));
    }
    let stamps = FOLDER.join("timestamps.txt");
    std::fs::write(&stamps, bytes).expect("a scratch file");
    if let Ok(times) = TimeStamps::read(&stamps)
        && let Some(origin) = times.origin_ns()
    {
        let _ = times.seconds(0, origin);
        let _ = times.all_seconds(origin);
        let _ = read_oxts(&FOLDER, origin);
    }
});
