//! A log of speeds of each kind from any bytes: GPX, NMEA, tables, CAN traces as text and Vector's BLF, a GoPro's track in a video.
//! Never a panic; what is read has finite speeds at rising times.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run log
#![no_main]

use deepfusion_logs::{ReadOptions, SpeedUnit, read};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| deepfusion_fuzz::scratch("log"));
const DBC: &str = "BO_ 291 Wheels: 8 X\n SG_ Speed : 7|16@0+ (0.01,0) [0|300] \"km/h\" X\n";

fuzz_target!(|bytes: &[u8]| {
    let dbc = FOLDER.join("car.dbc");
    if !dbc.exists() {
        std::fs::write(&dbc, DBC).expect("a scratch file");
    }
    let trace = ReadOptions {
        speed: Some("Wheels.Speed".into()),
        dbc: Some(dbc),
        ..ReadOptions::default()
    };
    let table = ReadOptions {
        unit: Some(SpeedUnit::KilometresPerHour),
        ..ReadOptions::default()
    };
    for ending in ["gpx", "nmea", "csv", "txt", "asc", "blf", "log", "mp4"] {
        let path = FOLDER.join("log").with_extension(ending);
        std::fs::write(&path, bytes).expect("a scratch file");
        for options in [&table, &trace] {
            let Ok(log) = read(&path, options) else {
                continue;
            };
            assert!(log.speeds.iter().all(|s| s.mps.is_finite()), "{ending}");
            assert!(log.speeds.is_sorted_by(|a, b| a.ns < b.ns), "{ending}");
        }
    }
});
