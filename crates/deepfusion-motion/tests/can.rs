//! Signals decoded from CAN frames, compared with cantools (`tests/reference/dbc.py`).

use deepfusion_hint::Hint;
use deepfusion_motion::Error;
use deepfusion_motion::can::{CanId, Dbc, ExpectedLayout};
use proptest::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

const DBC: &str = include_str!("reference/vehicle.dbc");

#[derive(Deserialize)]
struct Frame {
    message: String,
    id: u32,
    extended: bool,
    data: String,
    all: Vec<String>,
    values: BTreeMap<String, f64>,
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2);
    digits
        .map(|d| u8::from_str_radix(std::str::from_utf8(d).unwrap(), 16).unwrap())
        .collect()
}

#[test]
fn every_signal_equals_cantools() {
    let frames: Vec<Frame> = serde_json::from_str(include_str!("reference/dbc.json")).unwrap();
    let dbc = Dbc::parse(DBC).unwrap();
    let (mut there, mut absent) = (0, 0);
    for frame in &frames {
        let data = bytes(&frame.data);
        for name in &frame.all {
            let signal = dbc.signal(&format!("{}.{name}", frame.message)).unwrap();
            let id = match signal.id {
                CanId::Standard(id) => (u32::from(id), false),
                CanId::Extended { extended } => (extended, true),
            };
            assert_eq!(id, (frame.id, frame.extended), "{name}");
            match (signal.decode(&data), frame.values.get(name)) {
                // Both compute raw · scale + offset in f64; only the last bit may differ.
                (Some(ours), Some(theirs)) => {
                    let tolerance = 1e-12 * theirs.abs().max(1.0);
                    assert!(
                        (ours - theirs).abs() <= tolerance,
                        "{name}: {ours}, {theirs}"
                    );
                    there += 1;
                }
                (None, None) => absent += 1,
                (ours, theirs) => panic!("{name} in {}: {ours:?}, {theirs:?}", frame.data),
            }
        }
    }
    assert!(
        there > 500 && absent > 40,
        "{there} values, {absent} absent"
    );
}

#[test]
fn names_units_and_unknown_signals() {
    let dbc = Dbc::parse(DBC).unwrap();
    assert!(dbc.names().any(|n| n == "STEER_ANGLE_SENSOR.STEER_ANGLE"));
    assert_eq!(dbc.unit("POWERTRAIN_DATA.XMISSION_SPEED"), Some("km/h"));
    for (name, message) in [
        ("XMISSION_SPEED", "Message.Signal"),
        ("POWERTRAIN.XMISSION_SPEED", "the file has POWERTRAIN_DATA"),
        (
            "POWERTRAIN_DATA.SPEED",
            "`POWERTRAIN_DATA`, which has XMISSION_SPEED",
        ),
    ] {
        let error = dbc.signal(name).unwrap_err();
        assert!(matches!(error, Error::NoSignal { .. }));
        assert!(error.to_string().contains(message), "{error}");
    }
}

#[test]
fn a_broken_file_names_the_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("broken.dbc");
    std::fs::write(&path, DBC.replace("0|13@1+", "0|thirteen@1+")).unwrap();
    let error = Dbc::open(&path).unwrap_err();
    let expected = format!(
        "DBC: {}: line 23 is not written as in a DBC file",
        path.display()
    );
    assert_eq!(error.to_string(), expected);
    assert!(error.hint().is_some());
}

#[test]
fn a_missing_dbc_file_is_named() {
    let error = Dbc::open(Path::new("nowhere.dbc")).unwrap_err();
    assert_eq!(error.to_string(), "nowhere.dbc: no such file or folder");
    let hint = error.hint().unwrap();
    assert!(hint.contains("spelling"), "{hint}");
}

#[test]
fn units_in_latin_1_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("latin1.dbc");
    let mut text = DBC.replace("\"deg\"", "\"?\"").into_bytes();
    for byte in text.iter_mut().filter(|b| **b == b'?') {
        *byte = 0xb0;
    }
    std::fs::write(&path, text).unwrap();
    let dbc = Dbc::open(&path).unwrap();
    assert_eq!(dbc.unit("STEER_ANGLE_SENSOR.STEER_ANGLE"), Some("°"));
}

#[test]
fn a_signal_beyond_the_longest_frame_is_refused() {
    let dbc = Dbc::parse(&DBC.replace("501|11@1+", "501|12@1+")).unwrap();
    let error = dbc.signal("FD_INERTIAL.LAST_BITS").unwrap_err();
    let expected = ExpectedLayout::EndsWithin { bytes: 64 };
    assert!(
        matches!(&error, Error::Layout { field: "start_bit", expected: e, .. } if *e == expected),
        "{error}"
    );
    let message = "start_bit is 501, expected a position that ends within 64 bytes";
    assert!(error.to_string().ends_with(message), "{error}");
}

proptest! {
    #[test]
    fn garbage_never_panics(text in "(BO_|SG_| |:|[0-9]|\\||@|[a-zM]|\n|\"|;|,|-){0,200}", cut in 0usize..2500) {
        let _ = Dbc::parse(&text);
        // Truncated real files must not panic either.
        let piece = DBC.get(..cut.min(DBC.len())).unwrap_or_default();
        if let Ok(dbc) = Dbc::parse(&format!("{piece}{text}")) {
            for name in dbc.names().collect::<Vec<_>>() {
                let _ = dbc.signal(&name).map(|s| s.decode(&[0xa5; 8]));
            }
        }
    }
}
