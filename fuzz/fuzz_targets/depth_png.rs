//! A depth picture from any bytes: never a panic, never a size that its pixels do not fill, never a depth that is none.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run depth_png
#![no_main]

use deepfusion_images::{load_rgb, read_depth_png};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static FILE: LazyLock<PathBuf> =
    LazyLock::new(|| deepfusion_fuzz::scratch("depth_png").join("depth.png"));

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("a scratch file");
    if let Ok(depth) = read_depth_png(&FILE) {
        assert_eq!(depth.data.len(), depth.width * depth.height);
        assert!(depth.data.iter().all(|d| d.is_finite() && *d >= 0.0));
    }
    let _ = load_rgb(&FILE);
});
