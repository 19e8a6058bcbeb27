//! One log of each format, of a drive whose speeds and turns are known (`reference/make_logs.py`), read back; and damaged ones.

use deepfusion_logs::{
    Clock, ClockNote, DriveLog, Format, GoproLens, LogNote, ReadOptions, SpeedUnit, TableNote,
    TurnSign, TurnsNote, is_can_trace, read, read_all,
};
use std::path::{Path, PathBuf};

/// 2026-05-01 12:00:00 UTC.
const NOON_NS: i64 = 1_777_636_800_000_000_000;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(name)
}

fn plain(name: &str) -> DriveLog {
    read(&fixture(name), &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn a_missing_log_is_named() {
    let error = read(Path::new("nowhere.csv"), &ReadOptions::default()).unwrap_err();
    assert_eq!(error.to_string(), "nowhere.csv: no such file or folder");
}

fn true_speed(t: f64) -> f64 {
    8.0 + 3.0 * (0.4 * t).sin()
}

fn true_yaw_rate(t: f64) -> f64 {
    0.3 * (0.5 * t).sin()
}

/// The time within the drive, in seconds, if the drive begins at `origin_ns` on the log's clock.
fn seconds(ns: i64, origin_ns: i64) -> f64 {
    (ns - origin_ns) as f64 * 1e-9
}

#[track_caller]
fn speeds_are_true(log: &DriveLog, origin_ns: i64, count: usize, tolerance: f64) {
    assert_eq!(log.speeds.len(), count, "{:?}", log.notes);
    for pair in log.speeds.windows(2) {
        assert!(pair[0].ns < pair[1].ns);
    }
    for speed in &log.speeds {
        let expected = true_speed(seconds(speed.ns, origin_ns));
        assert!(
            (speed.mps - expected).abs() <= tolerance,
            "{speed:?}, truly {expected}"
        );
    }
}

#[test]
fn a_track_without_speeds_is_smoothed() {
    let log = plain("phone.gpx");
    assert_eq!((log.format, log.clock), (Format::Gpx, Clock::Date));
    assert_eq!(log.speeds.len(), 13);
    // One position a second, of a speed that varies by 3 m/s in 16 s: the ends have neighbours on one side only.
    for (i, speed) in log.speeds.iter().enumerate() {
        let error = (speed.mps - true_speed(seconds(speed.ns, NOON_NS))).abs();
        let sigma = speed.sigma_mps.unwrap();
        assert!(error < 1.5 * sigma, "{i}: {error}, sigma {sigma}");
        assert!(error < 0.6 || !(2..11).contains(&i), "{i}: {error}");
    }
}

/// A clock that steps back for a row: the row is left out and counted; a table out of order is refused at the first such row.
#[test]
fn a_row_that_goes_back_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trip.csv");
    let read_with = |back: &[i32]| {
        let row = |i: i32| {
            let late = if back.contains(&i) { 5 } else { 0 };
            format!("{},{i},0.1\n", f64::from(i - late) / 10.0)
        };
        let rows: String = (0..200).map(row).collect();
        std::fs::write(&file, format!("time_s,speed_mps,yaw_rate_radps\n{rows}")).unwrap();
        read(&file, &ReadOptions::default())
    };
    let log = read_with(&[50]).unwrap();
    assert_eq!((log.speeds.len(), log.yaw_rates.len()), (199, 199));
    assert!(log.speeds.iter().all(|speed| speed.mps != 50.0));
    let expected = LogNote::from(TableNote::Backwards { back: 1, rows: 200 });
    let times = log.notes.iter().filter(|note| **note == expected);
    assert_eq!(times.count(), 1, "{:?}", log.notes);
    let error = read_with(&[50, 60, 70]).unwrap_err().to_string();
    assert!(error.contains("trip.csv:52: "), "{error}");
    assert!(error.contains("0.4 s before the row above"), "{error}");
}

/// A clock that jumps ahead for a row, among the last of the table: this row is left out, not those after it.
#[test]
fn only_the_row_that_jumps_ahead_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trip.csv");
    let row = |i: i32| {
        let early = if i == 197 { 86_400 } else { 0 };
        format!("{},{i},0.1\n", f64::from(i + early) / 10.0)
    };
    let rows: String = (0..200).map(row).collect();
    std::fs::write(&file, format!("time_s,speed_mps,yaw_rate_radps\n{rows}")).unwrap();
    let log = read(&file, &ReadOptions::default()).unwrap();
    assert_eq!((log.speeds.len(), log.yaw_rates.len()), (199, 199));
    assert!(log.speeds.iter().all(|speed| speed.mps != 197.0));
    assert_eq!(log.speeds[198].mps, 199.0);
    let expected = LogNote::from(TableNote::Ahead {
        ahead: 1,
        rows: 200,
    });
    let times = log.notes.iter().filter(|note| **note == expected);
    assert_eq!(times.count(), 1, "{:?}", log.notes);
}

#[test]
fn a_tables_yaw_rate_is_read_if_its_unit_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("speed.csv");
    let read_with = |header: &str, factor: f64| {
        let row = |i: i32| {
            let t = 0.1 * f64::from(i);
            let turn = if i == 3 {
                String::new()
            } else {
                (factor * true_yaw_rate(t)).to_string()
            };
            format!("{t},{},{turn}\n", true_speed(t))
        };
        let rows: String = (0..30).map(row).collect();
        std::fs::write(&file, format!("time_s,speed_mps,{header}\n{rows}")).unwrap();
        read(&file, &ReadOptions::default()).unwrap()
    };
    for (header, factor) in [
        ("yaw_rate_radps", 1.0),
        ("yaw_rate_dps", 1f64.to_degrees()),
        ("Yaw Rate (deg/s)", 1f64.to_degrees()),
    ] {
        let log = read_with(header, factor);
        // One of the thirty was not measured.
        assert_eq!((log.speeds.len(), log.yaw_rates.len()), (30, 29));
        for turn in &log.yaw_rates {
            let error = turn.radps - true_yaw_rate(seconds(turn.ns, 0));
            assert!(error.abs() < 1e-9, "{header}: {error}");
        }
    }
    let log = read_with("yaw_rate", 1.0);
    assert!(log.yaw_rates.is_empty());
    let left_out = TableNote::YawRateUnit {
        column: "yaw_rate".into(),
        unit: None,
    };
    assert!(log.notes.contains(&left_out.into()), "{:?}", log.notes);
}

#[test]
fn torque_has_the_vehicles_speed_and_a_receivers() {
    let log = plain("torque.csv");
    assert_eq!((log.format, log.clock), (Format::Table, Clock::LocalDate));
    // In five of the 25 rows the vehicle did not answer; the receiver's speed, a metre a second higher, is not used.
    speeds_are_true(&log, NOON_NS, 20, 1e-3);
    for note in [
        TableNote::Column {
            time: "Device Time".into(),
            speed: "Speed (OBD)(km/h)".into(),
            unit: SpeedUnit::KilometresPerHour,
        },
        TableNote::NoSpeed {
            absent: 5,
            rows: 25,
        },
        TableNote::HeaderAgain { more: 1 },
    ] {
        let notes = &log.notes;
        assert!(notes.contains(&note.clone().into()), "{note}: {notes:?}");
    }
    let receiver = ReadOptions {
        speed: Some("GPS Speed (Meters/second)".into()),
        ..ReadOptions::default()
    };
    let log = read(&fixture("torque.csv"), &receiver).unwrap();
    assert!((log.speeds[0].mps - 9.0).abs() < 1e-9);
}

#[test]
fn car_scanner_has_one_value_per_row_and_decimal_commas() {
    let log = plain("car_scanner.csv");
    assert_eq!((log.format, log.clock), (Format::TallTable, Clock::Free));
    speeds_are_true(&log, 43_200_250_000_000, 49, 1e-4);
    let note = log.notes[0].to_string();
    assert!(note.contains("'Vehicle speed' in mph"), "{note}");
}

#[test]
fn sensor_logger_has_turns_too() {
    let log = plain("sensor_logger");
    assert_eq!((log.format, log.clock), (Format::ExportFolder, Clock::Date));
    speeds_are_true(&log, NOON_NS, 13, 1e-3);
    assert_eq!(log.speeds[0].sigma_mps, Some(0.3));
    assert_eq!(log.yaw_rates.len(), 301);
    for turn in &log.yaw_rates {
        let expected = true_yaw_rate(seconds(turn.ns, NOON_NS));
        assert!(
            (turn.radps - expected).abs() < 1e-4,
            "{turn:?}, truly {expected}"
        );
    }
    let turned = TurnsNote::AboutGravity(TurnSign::TurnedRound);
    assert!(
        log.notes.contains(&turned.clone().into()),
        "gravity points down there: {:?}",
        log.notes
    );
    // With another of its columns of time, both are on that column's clock.
    let elapsed = ReadOptions {
        time: Some("seconds_elapsed".into()),
        ..ReadOptions::default()
    };
    let log = read(&fixture("sensor_logger"), &elapsed).unwrap();
    assert_eq!(log.clock, Clock::Free);
    speeds_are_true(&log, 0, 13, 1e-3);
    assert_eq!(log.yaw_rates.first().map(|turn| turn.ns), Some(0));
    assert!(log.notes.contains(&turned.into()), "{:?}", log.notes);
}

#[test]
fn phyphox_counts_from_its_start() {
    let log = plain("phyphox.csv");
    assert_eq!(log.clock, Clock::Free);
    speeds_are_true(&log, 0, 13, 1e-6);
}

#[test]
fn gnss_logger_uses_only_fixes_from_gps() {
    let log = plain("gnss_log.txt");
    assert_eq!((log.format, log.clock), (Format::GnssLogger, Clock::Date));
    speeds_are_true(&log, NOON_NS, 13, 1e-4);
    assert_eq!(log.speeds[3].sigma_mps, Some(0.2));
}

#[test]
fn an_unknown_table_needs_the_names_of_its_columns() {
    let path = fixture("german.csv");
    let error = read(&path, &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("no column looks like a time; its columns: Zeitpunkt, Fahrt, Bemerkung"),
        "{error}"
    );
    let mut options = ReadOptions {
        time: Some("zeitpunkt".into()),
        ..ReadOptions::default()
    };
    let error = read(&path, &options).unwrap_err().to_string();
    assert!(
        error.contains("no column of numbers looks like a speed"),
        "{error}"
    );
    options.speed = Some("Fahrt".into());
    let error = read(&path, &options).unwrap_err().to_string();
    assert!(
        error.contains("the unit of the speed in column 'Fahrt' is not known"),
        "{error}"
    );
    options.unit = Some(SpeedUnit::Knots);
    let log = read(&path, &options).unwrap();
    assert_eq!(log.clock, Clock::LocalDate);
    speeds_are_true(&log, NOON_NS, 61, 1e-4);
    options.speed = Some("Tempo".into());
    let error = read(&path, &options).unwrap_err().to_string();
    assert!(error.contains("no column 'Tempo'"), "{error}");
}

#[test]
fn an_empty_file_is_not_said_to_have_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.csv");
    std::fs::write(&path, "").unwrap();
    let error = read(&path, &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(error.ends_with("the file has no header"), "{error}");
}

/// Speeds in UTC, and turns on a local clock.
#[test]
fn turns_without_a_zone_are_taken_as_utc_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let turns = folder.path().join("turns.csv");
    let row = |i: i32| format!("2026-05-01 14:00:{i:02},8,0.1\n");
    let rows: String = (0..12).map(row).collect();
    let text = format!("time,speed_mps,yaw_rate_radps\n{rows}");
    std::fs::write(&turns, text).unwrap();
    let logs = [fixture("phone.gpx"), turns];
    let read = |zone_s| {
        let read = read_all(&logs, &ReadOptions::default(), zone_s).unwrap();
        read.unwrap().0
    };
    let expected = LogNote::OfFile {
        file: "turns.csv".into(),
        note: Box::new(ClockNote::LocalDates.into()),
    };
    assert!(read(None).notes.contains(&expected));
    let in_zone = read(Some(7200));
    assert!(!in_zone.notes.contains(&expected));
    assert_eq!(in_zone.yaw_rates[0].ns, NOON_NS);
}

#[test]
fn can_traces_are_distinguished_from_other_logs() {
    for name in ["candump.log", "vector.asc", "vector.blf"] {
        assert!(is_can_trace(&fixture(name)), "{name}");
    }
    for name in [
        "torque.csv",
        "phone.gpx",
        "gopro.mp4",
        "vehicle.dbc",
        "absent.log",
    ] {
        assert!(!is_can_trace(&fixture(name)), "{name}");
    }
}

#[test]
fn can_traces_of_both_kinds_are_the_same() {
    let mut options = ReadOptions {
        dbc: Some(fixture("vehicle.dbc")),
        ..ReadOptions::default()
    };
    let error = read(&fixture("candump.log"), &options)
        .unwrap_err()
        .to_string();
    assert!(error.contains("WheelSpeeds.VehicleSpeed"), "{error}");
    options.speed = Some("WheelSpeeds.VehicleSpeed".into());
    let candump = read(&fixture("candump.log"), &options).unwrap();
    assert_eq!(
        (candump.format, candump.clock),
        (Format::CanTrace, Clock::Date)
    );
    // Half of the signal's step of 0.01 km/h.
    speeds_are_true(&candump, NOON_NS, 121, 0.0015);
    let vector = read(&fixture("vector.asc"), &options).unwrap();
    assert_eq!(vector.clock, Clock::Free);
    speeds_are_true(&vector, vector.speeds[0].ns, 121, 0.0015);
    let error = read(&fixture("candump.log"), &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("a CAN trace needs a DBC file that describes its frames"),
        "{error}"
    );
}

#[test]
fn a_track_shows_how_its_course_turned() {
    let log = plain("phone.gpx");
    assert!(log.yaw_rates.is_empty());
    assert_eq!(log.course_rates.len(), 12);
    let off = log.course_rates.iter().map(|turn| {
        let t = seconds(turn.ns, NOON_NS);
        (turn.radps - true_yaw_rate(t)).powi(2)
    });
    // Positions a second apart, smoothed as if accurate to a metre: the turns themselves have 0.2 rad/s.
    let rms = (off.sum::<f64>() / 12.0).sqrt();
    assert!(rms < 0.08, "{rms}");
}

#[test]
fn a_gopros_video_holds_its_own_log() {
    let log = plain("gopro.mp4");
    assert_eq!((log.format, log.clock), (Format::Gpmf, Clock::Video));
    // The first of twelve seconds has no fix. GPS5 counts speed in millimetres a second.
    speeds_are_true(&log, 0, 110, 6e-4);
    assert_eq!(log.yaw_rates.len(), 600);
    for turn in &log.yaw_rates {
        let expected = true_yaw_rate(seconds(turn.ns, 0));
        assert!(
            (turn.radps - expected).abs() < 5e-4,
            "{turn:?}, truly {expected}"
        );
    }
}

#[test]
fn a_gopros_video_names_its_lens() {
    let lens = GoproLens::read(&fixture("gopro.mp4")).unwrap().unwrap();
    assert_eq!(lens.model, "HERO11 Black");
    assert_eq!((lens.digital, lens.size), ('L', (1920, 1080)));
    // tan 47° = 1.0724; half a diagonal is √(960² + 540²) = 1101.5.
    let focal = lens.focal_px((1920, 1080)).unwrap();
    assert!((focal - 1101.454 / 1.072_369).abs() < 0.01, "{focal}");
    // A smaller copy, one stored upright, one cropped to whole blocks.
    let halved = lens.focal_px((960, 540)).unwrap();
    assert!((halved - focal / 2.0).abs() < 1e-9);
    assert_eq!(lens.focal_px((1080, 1920)), Some(focal));
    assert!(lens.focal_px((1920, 1088)).is_some());
    // Cropped to another shape, zoomed, or through a lens that bends lines.
    assert_eq!(lens.focal_px((1440, 1080)), None);
    let mut bytes = std::fs::read(fixture("gopro.mp4")).unwrap();
    let step = bytes.windows(4).position(|w| w == b"DZST").unwrap() + 8;
    bytes[step..step + 4].copy_from_slice(&50_u32.to_be_bytes());
    let folder = tempfile::tempdir().unwrap();
    let video = folder.path().join("zoomed.mp4");
    std::fs::write(&video, bytes).unwrap();
    let zoomed = GoproLens::read(&video).unwrap().unwrap();
    assert_eq!(zoomed.focal_px((1920, 1080)), None);
    let wide = GoproLens {
        digital: 'W',
        ..lens.clone()
    };
    assert_eq!(wide.focal_px((1920, 1080)), None);
    let no_angle = GoproLens {
        diagonal_deg: f64::NAN,
        ..lens
    };
    assert_eq!(no_angle.focal_px((1920, 1080)), None);
    // Any other file has no lens settings.
    assert_eq!(GoproLens::read(&fixture("phone.gpx")).ok().flatten(), None);
}

/// A copy of a fixture with its text changed.
fn changed(name: &str, change: impl Fn(&str) -> String) -> String {
    let text = std::fs::read_to_string(fixture(name)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, change(&text)).unwrap();
    read(&path, &ReadOptions::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn damaged_logs_are_named_by_line_and_column() {
    for (name, from, to, expected) in [
        (
            "torque.csv",
            ",30.946,",
            ",fast,",
            "torque.csv:3: column Speed (OBD)(km/h): 'fast' is not a number",
        ),
        (
            "torque.csv",
            "01-May-2026 12:00:01.000",
            "sometime",
            "torque.csv:4: column Device Time: 'sometime' is not a time",
        ),
        (
            "torque.csv",
            "01-May-2026 12:00:01.000",
            "01-May-2026 11:59:59.000",
            "torque.csv:4: column Device Time: '01-May-2026 11:59:59.000' is 1.5 s before",
        ),
        (
            "torque.csv",
            ",30.946,1800",
            "",
            "torque.csv:3: 7 values, the header has 9",
        ),
        (
            "torque.csv",
            "Speed (OBD)(km/h)",
            "Speed (OBD)",
            "GPS Speed",
        ),
        (
            "phyphox.csv",
            "1.000000000E+00,",
            "one,",
            "phyphox.csv:3: column Time (s): 'one' is not a time",
        ),
        (
            "gnss_log.txt",
            "9.16826",
            "9.1x",
            "gnss_log.txt:9: Fix, speedmps: '9.1x' is not a number",
        ),
        (
            "car_scanner.csv",
            "Vehicle speed",
            "Wheel turns",
            "no quantity looks like the vehicle's speed; the file has: Average speed, Engine RPM, Wheel turns",
        ),
    ] {
        if name == "torque.csv" && from == "Speed (OBD)(km/h)" {
            // Without its unit the vehicle's speed gives way to the receiver's, and the note says so.
            let text = std::fs::read_to_string(fixture(name))
                .unwrap()
                .replace(from, to);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let log = read(&path, &ReadOptions::default()).unwrap();
            let note = log.notes[0].to_string();
            assert!(note.contains(expected), "{note}");
            continue;
        }
        let error = changed(name, |text| text.replace(from, to));
        assert!(error.contains(expected), "{error}, not {expected}");
    }
}

#[test]
fn a_truncated_video_is_an_error_with_its_position() {
    let bytes = std::fs::read(fixture("gopro.mp4")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mp4");
    for length in (0..bytes.len()).step_by(97) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = read(&path, &ReadOptions::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains("cut.mp4"), "{length}: {error}");
    }
    // Damage anywhere gives an error or another number, never a panic.
    for at in (0..bytes.len()).step_by(13) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0xa5;
        std::fs::write(&path, &damaged).unwrap();
        let _ = read(&path, &ReadOptions::default());
    }
    // The lens settings are at the end.
    for at in bytes.len() - 300..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0xa5;
        std::fs::write(&path, &damaged).unwrap();
        let _ = GoproLens::read(&path);
    }
}
