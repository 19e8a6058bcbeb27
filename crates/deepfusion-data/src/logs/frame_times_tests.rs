use super::*;
use deepfusion_hint::Hint;

fn images(names: &[&str]) -> Vec<PathBuf> {
    names
        .iter()
        .map(|n| PathBuf::from(format!("{n}.png")))
        .collect()
}

fn timed(names: &[&str], files: &[(&str, &str)]) -> Result<Vec<(u64, Option<i64>)>> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let config = FolderConfig::read(folder.path())?;
    let timed = timed_images(folder.path(), images(names), &config, &mut Vec::new())?;
    Ok(timed.into_iter().map(|t| (t.number, t.ns)).collect())
}

const MS: i64 = 1_000_000;

#[test]
fn dates_in_names_are_times() {
    // EuRoC: nanoseconds; one frame is missing before the last.
    let names = [
        "1403636579763555584",
        "1403636579813555456",
        "1403636579913555456",
    ];
    let first = 1_403_636_579_763_555_584;
    let expected = [
        (0, Some(first)),
        (1, Some(first + 49_999_872)),
        (3, Some(first + 149_999_872)),
    ];
    // With two steps, 50 and 100 ms, the median would be the longer, so another of 50 is needed.
    let names: Vec<&str> = names.into_iter().chain(["1403636579963555456"]).collect();
    let found = timed(&names, &[]).unwrap();
    assert_eq!(found[..3], expected);
    assert_eq!(found[3].0, 4);
    // TUM: seconds.
    let found = timed(&["1305031102.175304", "1305031102.211214"], &[]).unwrap();
    assert_eq!(found[1].1.unwrap() - found[0].1.unwrap(), 35_910_000);
}

#[test]
fn numbers_are_kept_and_need_a_rate() {
    assert_eq!(
        timed(&["000007", "000005"], &[]).unwrap(),
        [(5, None), (7, None)]
    );
    let found = timed(
        &["000007", "000005"],
        &[("dataset.toml", "fps = 25\nstart_s = 3")],
    );
    // 5 is the first, at 3 s; 7 comes two intervals later.
    assert_eq!(found.unwrap(), [(5, Some(3000 * MS)), (7, Some(3080 * MS))]);
}

/// With `fps`, EuRoC's names are not used as frame numbers: the frames would be years apart.
#[test]
fn with_fps_dates_in_names_are_not_frame_numbers() {
    let names = ["1403636579763555584", "1403636579813555456"];
    let found = timed(&names, &[("dataset.toml", "fps = 20")]).unwrap();
    let times: Vec<_> = found.iter().map(|(_, ns)| ns.unwrap()).collect();
    assert_eq!(times, [0, 50 * MS]);
}

/// As `ffmpeg frame_%d.png` writes them.
#[test]
fn numbers_in_names_need_no_leading_zeros() {
    let names: Vec<String> = (1..=12).map(|i| format!("frame_{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let config = FolderConfig {
        fps: Some(10.0),
        ..FolderConfig::default()
    };
    let (folder, mut warnings) = (tempfile::tempdir().unwrap(), Vec::new());
    let mut given = images(&names);
    given.sort();
    let found = timed_images(folder.path(), given, &config, &mut warnings).unwrap();
    let paths: Vec<PathBuf> = found.iter().map(|image| image.path.clone()).collect();
    assert_eq!(paths, images(&names));
    let times: Vec<i64> = found.iter().map(|image| image.ns.unwrap()).collect();
    let expected: Vec<i64> = (0..12).map(|i| i * 100 * MS).collect();
    assert_eq!(times, expected);
}

#[test]
fn a_break_of_years_leaves_out_a_limited_range_of_numbers() {
    let numbers = numbers_by_time(&[0, 100 * MS, 200 * MS, 1 << 60, (1 << 60) + 100 * MS]);
    assert_eq!(numbers, [0, 1, 2, 100_002, 100_003]);
}

#[test]
fn lists_and_tables_are_read() {
    let found = timed(&["a", "b"], &[("timestamps.txt", "0.5\n0.6\n")]).unwrap();
    assert_eq!(found, [(0, Some(500 * MS)), (1, Some(600 * MS))]);
    let list = "2011-09-26 13:04:32.3\n2011-09-26 13:04:32.4\n";
    let found = timed(&["a", "b"], &[("timestamps.txt", list)]).unwrap();
    assert_eq!(found[1].1.unwrap() - found[0].1.unwrap(), 100 * MS);
    let table = "time_ms,file\n10,images/b.png\n20,a.png\n";
    let found = timed(&["a", "b", "c"], &[("frames.csv", table)]).unwrap();
    assert_eq!(found, [(0, Some(10 * MS)), (1, Some(20 * MS))]);
}

#[test]
fn dates_with_a_zone_are_read() {
    let start = 1_714_557_600_123 * MS;
    let expected = [(0, Some(start)), (1, Some(start + 100 * MS))];
    let list = "2024-05-01T10:00:00.123Z\n2024-05-01T12:00:00.223+02:00\n";
    let table =
        "timestamp,file\n2024-05-01T10:00:00.123Z,a.png\n2024-05-01T12:00:00.223+02:00,b.png\n";
    for (file, text) in [("timestamps.txt", list), ("frames.csv", table)] {
        let found = timed(&["a", "b"], &[(file, text)]).unwrap();
        assert_eq!(found, expected, "{file}");
    }
}

/// Dates without a time zone would be off by hours from a log in UTC if they are local.
#[test]
fn dates_without_a_zone_give_one_warning_per_list() {
    let warned = |list: &str| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("times.txt"), list).unwrap();
        let mut warnings = Vec::new();
        let config = FolderConfig::default();
        timed_images(folder.path(), images(&["a", "b"]), &config, &mut warnings).unwrap();
        warnings
    };
    let no_zone = TimesWarning::NoZone {
        log: "times.txt".into(),
    };
    for list in [
        "2011-09-26 13:04:32.3\n2011-09-26 13:04:32.4\n",
        "26.09.2011 13:04:32.3\n26.09.2011 13:04:32.4\n",
    ] {
        assert_eq!(warned(list), [DataWarning::from(no_zone.clone())], "{list}");
    }
    for list in ["2024-05-01T10:00:00Z\n2024-05-01T10:00:01Z\n", "0.5\n0.6\n"] {
        assert!(warned(list).is_empty(), "{list}");
    }
}

#[test]
fn invalid_lists_and_tables_are_errors() {
    for (file, text, problem) in [
        ("timestamps.txt", "0.5\n", "1 time, but there are 2 images"),
        (
            "timestamps.txt",
            "0.5\nx\n",
            "timestamps.txt:2: 'x' is not a time",
        ),
        (
            "timestamps.txt",
            "0.6\n0.5\n",
            "timestamps.txt:2: '0.5' is not after",
        ),
        (
            "timestamps.txt",
            "0\n40\n",
            "timestamps.txt: the unit of its times is not given",
        ),
        (
            "frames.csv",
            "time_s,file\n0,z.png\n",
            "frames.csv:2: column file: 'z.png' is not the name",
        ),
        (
            "frames.csv",
            "time_s,picture\n0,a.png\n",
            "no column 'file'",
        ),
    ] {
        let error = timed(&["a", "b"], &[(file, text)]).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

#[test]
fn a_table_without_a_header_gets_an_example_of_its_own() {
    let error = timed(&["a", "b"], &[("frames.csv", "0.0,a.png\n0.1,b.png\n")]).unwrap_err();
    assert!(error.to_string().contains("no column 'time'"), "{error}");
    let hint = error.hint().unwrap();
    assert!(hint.ends_with("such as time_s,file"), "{hint}");
}
