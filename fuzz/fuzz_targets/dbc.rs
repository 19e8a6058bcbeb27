//! A DBC file from any bytes, every signal of it taken and read from frames of all lengths: never a panic, and a number
//! only from a frame that is long enough.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run dbc
#![no_main]

use deepfusion_motion::can::Dbc;
use libfuzzer_sys::fuzz_target;

/// Bits that differ in every byte, so that no layout reads zeros only.
fn frame<const N: usize>() -> [u8; N] {
    std::array::from_fn(|i| (i as u8).wrapping_mul(37) ^ 0xa5)
}

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let Ok(dbc) = Dbc::parse(&text) else {
        return;
    };
    for name in dbc.names().take(64) {
        let _ = dbc.unit(&name);
        let Ok(signal) = dbc.signal(&name) else {
            continue;
        };
        assert_eq!(signal.decode(&[]), None, "{name}");
        let _ = signal.decode(&frame::<1>());
        let _ = signal.decode(&frame::<8>());
        if let Some(value) = signal.decode(&frame::<64>()) {
            assert!(!value.is_nan(), "{name}");
        }
    }
});
