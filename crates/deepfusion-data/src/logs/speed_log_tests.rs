use super::*;
use crate::Error;
use deepfusion_hint::Hint;
use std::fs;

fn read(files: &[(&str, &str)]) -> Result<SpeedLog> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let config = FolderConfig::read(folder.path())?;
    Ok(SpeedLog::read(folder.path(), &config)?.expect("there is a speed.csv"))
}

/// Its warnings, one per line.
fn text_of(log: &SpeedLog) -> String {
    let lines: Vec<String> = log.warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

fn refusal(files: &[(&str, &str)]) -> Error {
    read(files).unwrap_err()
}

#[test]
fn units_come_from_the_header_or_the_config() {
    let expected = [10.0, 20.0];
    for (files, factor) in [
        (vec![("speed.csv", "time_s,speed_mps\n0,10\n0.1,20\n")], 1.0),
        (vec![("speed.csv", "time_s,speed_kmh\n0,36\n0.1,72\n")], 1.0),
        (
            vec![("speed.csv", "Timestamp [ms],Speed (km/h)\n0,36\n100,72\n")],
            1.0,
        ),
        (
            vec![("speed.csv", "t_ns,v_mph\n0,10\n100000000,20\n")],
            0.44704,
        ),
        (
            vec![
                ("speed.csv", "time,speed\n0,36\n100,72\n"),
                ("dataset.toml", "speed_unit = 'km/h'\ntime_unit = 'ms'\n"),
            ],
            1.0,
        ),
    ] {
        let log = read(&files).unwrap();
        assert_eq!(log.speeds_mps.ns, [0, 100_000_000], "{files:?}");
        for (found, expected) in log.speeds_mps.values.iter().zip(expected) {
            assert!((found - expected * factor).abs() < 1e-12, "{files:?}");
        }
    }
}

#[test]
fn times_may_be_dates() {
    let (start, tenth) = (1_714_557_600_123_000_000, 100_000_000);
    for (zone, warned) in [("Z", false), ("", true)] {
        let table = format!(
            "timestamp,speed_mps\n2024-05-01T10:00:00.123{zone},3\n2024-05-01 10:00:00.223{zone},4\n"
        );
        let log = read(&[("speed.csv", &table)]).unwrap();
        assert_eq!(log.speeds_mps.ns, [start, start + tenth], "{zone}");
        let warns = text_of(&log).contains("assuming UTC");
        assert_eq!(warns, warned, "{zone}");
    }
    // Either all times in a column have a zone, or none.
    let mixed = "timestamp,speed_mps\n2024-05-01T10:00:00Z,3\n2024-05-01T10:00:01,4\n";
    let error = refusal(&[("speed.csv", mixed)]).to_string();
    assert!(error.contains(":3: column timestamp: "), "{error}");
    let seconds = "timestamp,speed_mps\n2024-05-01T10:00:00Z,3\n1714557601,4\n";
    let error = refusal(&[("speed.csv", seconds)]).to_string();
    assert!(error.contains("'1714557601' is not a time"), "{error}");
}

#[test]
fn a_unit_is_never_guessed() {
    let error = refusal(&[("speed.csv", "time_s,speed\n0,36\n")]);
    assert!(
        error
            .to_string()
            .contains("column speed: no unit of speed is given"),
        "{error}"
    );
    assert!(error.hint().unwrap().contains("speed_kmh"), "{error}");
    let error = refusal(&[("speed.csv", "time,speed_mps\n0,36\n40,36\n80,36\n")]);
    assert!(
        error
            .to_string()
            .contains("column time: no unit of time is given"),
        "{error}"
    );
    let error = refusal(&[("speed.csv", "time_s,speed_mps,yaw_rate\n0,36,0\n")]);
    assert!(
        error
            .to_string()
            .contains("column yaw_rate: no unit of yaw rate is given"),
        "{error}"
    );
    let error = refusal(&[("speed.csv", "time_s,speed (furlong/h)\n0,36\n")]);
    assert!(error.to_string().contains("furlong/h"), "{error}");
    // A unit that follows from the magnitude is used, with a warning.
    let log = read(&[(
        "speed.csv",
        "timestamp,speed_mps\n1403636579763555584,3\n1403636579863555584,3\n",
    )]);
    let log = log.unwrap();
    assert_eq!(log.speeds_mps.ns[0], 1_403_636_579_763_555_584);
    let message = log.warnings[0].to_string();
    assert!(message.contains("assuming ns"), "{message}");
}

#[test]
fn bad_rows_are_named() {
    for (text, expected) in [
        (
            "time_s,speed_mps\n0,1\n0.1,fast\n",
            ":3: column speed_mps: 'fast' is not a finite number",
        ),
        (
            "time_s,speed_mps\n0,1\n0.1,\n",
            ":3: column speed_mps: empty, expected a finite number",
        ),
        (
            "time_s,speed_mps\n0,1\n0.2,1\n0.1,1\n",
            ":4: column time_s: '0.1' is 0.1 s before the row above",
        ),
        (
            "time_s,speed_mps\n0,1\nsoon,1\n",
            ":3: column time_s: 'soon' is not a time",
        ),
        ("time_s,speed_mps\n", "no row below the header"),
        (
            "time_s,speed_mps\n0,1,2\n",
            ":2: 3 values, but the header has 2",
        ),
        ("", "speed.csv: the file is empty"),
        (
            "time_s,sped_mps\n0,1\n",
            "no column 'speed', only time_s, sped_mps",
        ),
        (
            "when,speed_mps\n0,1\n",
            "no column 'time', only when, speed_mps",
        ),
    ] {
        let error = refusal(&[("speed.csv", text)]).to_string();
        assert!(
            error.contains("speed.csv") && error.ends_with(expected),
            "{error}"
        );
    }
}

#[test]
fn repeated_times_and_slow_clocks_are_reported() {
    let log = read(&[("speed.csv", "time_s,speed_mps\n0,1\n0,2\n0.1,1\n")]).unwrap();
    let text = text_of(&log);
    assert!(
        text.contains("1 row repeats the time of the row above (in line 3)"),
        "{text}"
    );
    assert_eq!(log.track(0).times_s(), [0.0, 0.1]);
    assert!(!text.contains("gap"), "{text}");
}

/// One speed per second, as GPS receivers and phones write it, is bridged. A gap in it is not, nor is one in a fast log, unless
/// `dataset.toml` allows it.
#[test]
fn slow_logs_are_bridged() {
    let known = |text: &str, config: &str, at: &[f64]| {
        let log = read(&[("speed.csv", text), ("dataset.toml", config)]).unwrap();
        let track = log.track(0);
        let known: Vec<Option<f64>> = at.iter().map(|t| track.speed_at(*t)).collect();
        (known, text_of(&log))
    };
    let slow = "time_s,speed_mps\n0,1\n1,2\n2,1\n3,1\n7,1\n8,1\n";
    let (speeds, warnings) = known(slow, "", &[0.5, 1.25, 5.0]);
    assert_eq!(speeds, [Some(1.5), Some(1.75), None]);
    assert!(
        warnings.contains("speeds are interpolated linearly across 4 gaps of up to 1.0 s"),
        "{warnings}"
    );
    assert!(warnings.contains("1 gap of more than 3.0 s"), "{warnings}");
    assert_eq!(known(slow, "max_gap_s = 4", &[5.0]).0, [Some(1.0)]);
    assert_eq!(known(slow, "max_gap_s = 0.4", &[0.5]).0, [None]);

    let mut fast: String = (0..20)
        .map(|i| format!("{},1\n", f64::from(i) / 10.0))
        .collect();
    fast = format!("time_s,speed_mps\n{fast}3.5,1\n3.6,1\n");
    assert_eq!(known(&fast, "", &[1.0, 2.7]).0, [Some(1.0), None]);
    assert_eq!(known(&fast, "max_gap_s = 2", &[2.7]).0, [Some(1.0)]);
    let error = refusal(&[("speed.csv", slow), ("dataset.toml", "max_gap_s = 0")]);
    assert!(error.to_string().contains("max_gap_s is 0"), "{error}");
    let error = refusal(&[("speed.csv", slow), ("dataset.toml", "max_gap_s = 1e9")]);
    assert!(error.to_string().contains("at most 60 s"), "{error}");
}

#[test]
fn a_gps_track_gives_speeds() {
    let point = |i: i32| {
        format!(
            "<trkpt lat=\"{:.7}\" lon=\"8.4\"><time>2026-05-01T12:00:{i:02}Z</time></trkpt>",
            49.0 + f64::from(i) * 1e-4
        )
    };
    let points: String = (0..20).map(point).collect();
    let gpx = format!("<gpx><trk><trkseg>{points}</trkseg></trk></gpx>");
    let log = read(&[
        ("walk.gpx", &gpx),
        ("dataset.toml", "vehicle.speed_scale = 0.5"),
    ])
    .unwrap();
    let speed = log.speeds_mps.at(1_777_636_805_400_000_000).unwrap();
    assert!((speed - 0.5 * 11.12).abs() < 0.02, "{speed}");
    let text = text_of(&log);
    assert!(text.contains("from its positions, smoothed"), "{text}");
    let error = refusal(&[("a.gpx", &gpx), ("b.gpx", &gpx)]);
    assert!(
        error.to_string().contains("the folder has 2 tracks"),
        "{error}"
    );
    let named = read(&[
        ("a.gpx", &gpx),
        ("b.gpx", &gpx),
        ("dataset.toml", "speed = 'b.gpx'"),
    ])
    .unwrap();
    assert!(named.path.ends_with("b.gpx"));
    let both = read(&[
        ("a.gpx", &gpx),
        ("speed.csv", "time_s,speed_mps\n0,1\n0.1,1\n"),
    ])
    .unwrap();
    assert!(both.path.ends_with("speed.csv"));
}

#[test]
fn the_yaw_rate_comes_from_the_imu_on_its_own_clock() {
    let imu: String = (0..101)
        .map(|i| format!("{},{}\n", i * 10, 18.0 * f64::from(i) / 100.0))
        .collect();
    let speeds: String = (0..11)
        .map(|i| format!("{},5\n", f64::from(i) * 0.1))
        .collect();
    let log = read(&[
        ("speed.csv", &format!("time_s,speed_mps\n{speeds}")),
        ("imu.csv", &format!("time_ms,gyro_z_dps\n{imu}")),
    ])
    .unwrap();
    assert_eq!(log.streams[1].rate_hz.map(f64::round), Some(100.0));
    // 18 t degrees per second integrate to 9 t² degrees.
    let motion = log.track(0).motion(0.0, 1.0).unwrap();
    assert!(
        (motion.yaw_rad - 9_f64.to_radians()).abs() < 1e-9,
        "{motion:?}"
    );
    assert!((motion.distance_m - 5.0).abs() < 1e-9);
}

/// 10 m/s and 0.2 rad/s to the left for 5 s, measured at 100 Hz by a unit that is rotated by 90° to the left: its x points
/// to the vehicle's left.
fn turning_unit(header: &str, rates: f64, accelerations: f64) -> String {
    let mut table = format!("{header}\n");
    for i in 0..=500 {
        // Centripetal acceleration is 2 m/s² to the left; the reaction to gravity points up.
        let [ax, ay, az] = [2.0, 0.0, 9.806_65].map(|a| a / accelerations);
        table += &format!(
            "{},0,0,{},{ax},{ay},{az}\n",
            f64::from(i) * 0.01,
            0.2 / rates
        );
    }
    table
}

#[test]
fn a_complete_inertial_unit_is_fused_with_the_speed() {
    let mut speed = "time_s,speed_mps\n".to_owned();
    (0..=50).for_each(|i| speed += &format!("{},10\n", f64::from(i) * 0.1));
    let mount = "[vehicle_from_imu]\nrotation = [0.0, 0.0, 1.5707963]\n";
    for (header, rates, accelerations) in [
        (
            "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2",
            1.0,
            1.0,
        ),
        (
            "t_s,wx [deg/s],wy [deg/s],wz [deg/s],ax [g],ay [g],az [g]",
            1_f64.to_radians(),
            9.806_65,
        ),
    ] {
        let unit = turning_unit(header, rates, accelerations);
        let log = read(&[
            ("speed.csv", &speed),
            ("imu.csv", &unit),
            ("dataset.toml", mount),
        ])
        .unwrap();
        let (motion, yaw_known) = log.motion(0).unwrap();
        assert!(yaw_known && matches!(motion, MotionModel::Fused(_)));
        let driven = motion.motion(1.0, 3.0).unwrap();
        assert!((driven.yaw_rad - 0.4).abs() < 0.01, "{driven:?}");
        assert!((driven.distance_m - 20.0).abs() < 0.2, "{driven:?}");
    }
    // A unit that is upside down is an error.
    let upside_down = "[vehicle_from_imu]\nrotation = [3.14159265, 0.0, 0.0]\n";
    let header =
        "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";
    let unit = turning_unit(header, 1.0, 1.0);
    let log = read(&[
        ("speed.csv", &speed),
        ("imu.csv", &unit),
        ("dataset.toml", upside_down),
    ])
    .unwrap();
    let error = log.motion(0).unwrap_err();
    assert!(matches!(error, Error::Motion { .. }), "{error}");
    assert!(error.to_string().contains("speed.csv"), "{error}");
}

#[test]
fn units_of_an_inertial_unit_are_never_guessed() {
    let header = "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x,accel_y,accel_z";
    let unit = turning_unit(header, 1.0, 1.0);
    let error = refusal(&[
        ("speed.csv", "time_s,speed_mps\n0,10\n"),
        ("imu.csv", &unit),
    ]);
    assert!(
        error
            .to_string()
            .contains("column accel_x: no unit of acceleration is given"),
        "{error}"
    );
    assert!(error.hint().unwrap().contains("accel_x_mps2"), "{error}");
}

#[test]
fn the_course_of_positions_is_read_only_without_a_yaw_rate() {
    let speed = ("speed.csv", "time_s,speed_mps\n0,10\n1,10\n");
    let course = ("course.csv", "time_s,course_rate_radps\n0,0.1\n1,0.2\n");
    let rates = |files: &[(&str, &str)]| {
        let log = read(files).unwrap();
        let warnings = text_of(&log);
        (log.course_rates_radps.map(|c| c.values), warnings)
    };
    assert_eq!(rates(&[speed, course]).0, Some(vec![0.1, 0.2]));
    let with_yaw = (
        "speed.csv",
        "time_s,speed_mps,yaw_rate_radps\n0,10,0\n1,10,0\n",
    );
    assert_eq!(rates(&[with_yaw, course]).0, None);
    // Another program's table of that name is not an error.
    for other in ["lesson,room\nA,1\n", "time_s,course_deg\n0,10\n", ""] {
        let (found, warnings) = rates(&[speed, ("course.csv", other)]);
        assert_eq!(found, None, "{other}");
        assert!(
            warnings
                .lines()
                .any(|line| line.starts_with("course.csv: not read")),
            "{warnings}"
        );
    }
}
