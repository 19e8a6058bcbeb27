//! GPS tracks: GPX and NMEA, good and damaged.

use deepfusion_hint::Hint;
use deepfusion_logs::{DriveLog, Error, ReadOptions};
use std::fs;

fn read(name: &str, text: &str) -> Result<DriveLog, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    deepfusion_logs::read(&path, &ReadOptions::default())
}

fn refusal(name: &str, text: &str) -> String {
    let error = read(name, text).expect_err("it is refused");
    assert!(error.hint().is_some());
    error.to_string()
}

/// Points a second apart and `step` degrees of latitude apart, as an app writes them.
fn track(points: usize, step: f64, speed: impl Fn(usize) -> String) -> String {
    let point = |i: usize| {
        format!(
            "<trkpt lat=\"{:.8}\" lon=\"8.4\"><ele>110</ele><time>2026-05-01T12:00:{i:02}.250Z</time>{}</trkpt>\n",
            49.0 + step * i as f64,
            speed(i)
        )
    };
    let points: String = (0..points).map(point).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<gpx version=\"1.1\" xmlns:gpxtpx=\"x\"><trk><trkseg>\n{points}</trkseg></trk></gpx>\n"
    )
}

#[test]
fn a_gpx_track_gives_speeds_at_its_dates() {
    // A degree of latitude is 111.2 km there: 10 m/s.
    let log = read("a.gpx", &track(30, 10.0 / 111_206.0, |_| String::new())).unwrap();
    assert_eq!(log.speeds.len(), 30);
    let note = log.notes[0].to_string();
    assert!(note.contains("from its positions"), "{note}");
    assert_eq!(log.speeds[0].ns, 1_777_636_800_250_000_000);
    assert_eq!(log.speeds[1].ns - log.speeds[0].ns, 1_000_000_000);
    for speed in &log.speeds {
        assert!((speed.mps - 10.0).abs() < 0.02, "{speed:?}");
    }
}

#[test]
fn a_speed_in_an_extension_is_used() {
    let extension = |i: usize| {
        format!(
            "<extensions><gpxtpx:TrackPointExtension><gpxtpx:speed>{}.5</gpxtpx:speed></gpxtpx:TrackPointExtension></extensions>",
            i
        )
    };
    let log = read("a.gpx", &track(5, 1e-4, extension)).unwrap();
    let note = log.notes[0].to_string();
    assert!(note.contains("as the receiver measured"), "{note}");
    let speeds: Vec<f64> = log.speeds.iter().map(|s| s.mps).collect();
    assert_eq!(speeds, [0.5, 1.5, 2.5, 3.5, 4.5]);
}

/// iOS writes -1 for an unknown speed; OsmAnd writes none if it is 0.
#[test]
fn a_point_without_a_speed_does_not_discard_the_others() {
    for unknown in ["<speed>-1</speed>", ""] {
        let speed = |i: usize| {
            let own = format!("<speed>{i}.5</speed>");
            if i == 0 { unknown.to_owned() } else { own }
        };
        let log = read("a.gpx", &track(5, 0.0, speed)).unwrap();
        let speeds: Vec<f64> = log.speeds.iter().map(|s| s.mps).collect();
        assert_eq!(speeds, [0.0, 1.5, 2.5, 3.5, 4.5], "{unknown}");
        let notes: Vec<String> = log.notes.iter().map(ToString::to_string).collect();
        assert!(notes[0].contains("as the receiver measured"), "{notes:?}");
        assert!(notes[1].ends_with("1 of 5 fixes"), "{notes:?}");
    }
}

#[test]
fn errors_in_a_track_name_the_line() {
    let good = track(5, 1e-4, |_| String::new());
    for (bad, expected) in [
        (
            good.replacen("lon=\"8.4\"", "lon=\"east\"", 1),
            "a.gpx:3: lon: 'east' is not an angle",
        ),
        (
            good.replacen("lat=", "latitude=", 1),
            "a.gpx:3: lat: missing in this point",
        ),
        (
            good.replace("12:00:01.250Z", "noon"),
            "a.gpx:4: time: '2026-05-01Tnoon'",
        ),
        (
            good.replacen("</ele>", "</ele><speed>fast</speed>", 2),
            "a.gpx:3: speed: 'fast' is not a speed",
        ),
        (good[..good.len() - 100].to_owned(), "a.gpx:"),
        ("<html></html>".to_owned(), "not a GPX file"),
        (good.replacen("<ele>", "</ele>", 1), "a.gpx:3: XML: "),
        (track(1, 0.0, |_| String::new()), "1 fix with a time"),
        (good.replace("time>", "clock>"), "0 fixes with a time"),
    ] {
        let error = refusal("a.gpx", &bad);
        assert!(error.contains(expected), "{error}, not {expected}");
    }
}

fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

#[test]
fn sentences_give_the_receivers_speed() {
    let rmc = |second: usize, status: char, knots: f64| {
        sentence(&format!(
            "GPRMC,1200{second:02}.50,{status},4900.0000,N,00824.0000,E,{knots:.1},90.0,010526,,,A"
        ))
    };
    let gga = sentence("GPGGA,120000.50,4900.0000,N,00824.0000,E,1,08,1.0,110.0,M,48.0,M,,");
    let text = [
        gga,
        rmc(0, 'A', 10.0),
        "noise $\u{e9}\u{20ac}\u{20ac}\n".into(),
        rmc(1, 'V', 99.0),
        rmc(2, 'A', 20.0),
        rmc(3, 'A', 20.0),
    ]
    .concat();
    let log = read("a.nmea", &text).unwrap();
    let speeds: Vec<f64> = log
        .speeds
        .iter()
        .map(|s| (s.mps * 100.0).round() / 100.0)
        .collect();
    assert_eq!(
        speeds,
        [5.14, 10.29, 10.29],
        "knots; a void fix does not count"
    );
    assert_eq!(log.speeds[0].ns, 1_777_636_800_500_000_000);
    let damaged = text.replace("20.0,90.0", "29.0,90.0");
    let error = refusal("a.nmea", &damaged);
    assert!(error.contains("a.nmea:5: RMC: the checksum is"), "{error}");
    assert!(refusal("a.nmea", "hello\n").contains("no NMEA sentence"));
}
