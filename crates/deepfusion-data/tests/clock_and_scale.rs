//! A clock offset and a speed scale are corrected once, in every layout.

use crate::common::bag::{CAMERA, TinyBag};
use crate::common::folder;
use crate::common::{TinyDrive, packet};
use deepfusion_data::{Dataset, OpenOptions, convert_to_bag, convert_to_kitti, inspect};
use deepfusion_hint::Hint;
use deepfusion_rosbag::Compression;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// How far the camera's clock is ahead in the files written here, in seconds.
const AHEAD_S: f64 = 0.2;
/// The speed scale in the files written here.
const SCALE: f64 = 0.9;
const BOTH: &str = "[clock]\ncamera_ahead_s = 0.2\n[vehicle]\nspeed_scale = 0.9\n";

/// Speed in m/s at a time in seconds on the vehicle's clock.
fn speed_mps(t: f64) -> f64 {
    4.0 + 3.0 * t
}

/// A drive with increasing speed.
struct Drive {
    layout: &'static str,
    /// Path to open.
    path: PathBuf,
    /// Path of the configuration file, which does not exist yet.
    config: PathBuf,
    /// Index of a frame with speeds around it, with either clock ahead.
    frame: usize,
    /// Time of that frame in seconds, on the vehicle's clock if the two clocks agree.
    at_s: f64,
    _folder: TempDir,
}

impl Drive {
    fn speed(&self, options: &OpenOptions) -> f64 {
        open(&self.path, options).frames()[self.frame]
            .speed_mps
            .unwrap()
    }
}

fn open(path: &Path, options: &OpenOptions) -> Dataset {
    Dataset::open(path, options).unwrap().remove(0)
}

/// One drive of each layout that needs no other program.
fn drives() -> Vec<Drive> {
    let root = || tempfile::tempdir().unwrap();
    let kitti = root();
    let drive = TinyDrive::default().write(kitti.path());
    for n in 0..8 {
        let path = drive.join(format!("oxts/data/{n:010}.txt"));
        fs::write(path, packet(speed_mps(0.349 + 0.103 * f64::from(n)), 0.0)).unwrap();
    }
    let images = root();
    folder::write_drive(images.path(), 8, 1.0, 0.0);
    let mut table = "time_s,speed_mps,yaw_rate_radps\n".to_owned();
    for n in 0..20 {
        let t = 0.1 * f64::from(n);
        table += &format!("{t:.9},{},0.0\n", speed_mps(t));
    }
    fs::write(images.path().join("speed.csv"), table).unwrap();
    let bagged = root();
    let path = bagged.path().join("drive.bag");
    let mut bag = TinyBag::new(&path, "/camera/image");
    bag.turning_twist("/twist", |t| (speed_mps(t), 0.01));
    bag.finish();
    vec![
        Drive {
            layout: "KITTI",
            config: drive.join("dataset.toml"),
            path: drive,
            frame: 5,
            at_s: 0.345 + 5.0 * 0.103,
            _folder: kitti,
        },
        Drive {
            layout: "folder",
            path: images.path().to_owned(),
            config: images.path().join("dataset.toml"),
            frame: 5,
            at_s: 0.345 + 5.0 * 0.103,
            _folder: images,
        },
        Drive {
            layout: "bag",
            config: path.with_extension("toml"),
            path,
            frame: 15,
            at_s: 15.0 * 0.04,
            _folder: bagged,
        },
    ]
}

fn write_config(drive: &Drive, text: &str) {
    let camera = if drive.layout == "bag" { CAMERA } else { "" };
    fs::write(&drive.config, format!("{camera}{text}")).unwrap();
}

fn near(found: f64, expected: f64, of: &str) {
    assert!(
        (found - expected).abs() < 1e-6,
        "{of}: {found}, not {expected}"
    );
}

#[test]
fn clock_offset_and_speed_scale_are_applied_once_in_every_layout() {
    for drive in drives() {
        let (of, t) = (drive.layout, drive.at_s);
        let default = OpenOptions::default();
        let ahead = |seconds| OpenOptions {
            camera_ahead_s: Some(seconds),
            ..OpenOptions::default()
        };
        write_config(&drive, "");
        near(drive.speed(&default), speed_mps(t), of);
        // Only the option: the camera's time t is 0.1 s earlier on the vehicle's clock.
        near(drive.speed(&ahead(0.1)), speed_mps(t - 0.1), of);
        near(drive.speed(&ahead(-0.05)), speed_mps(t + 0.05), of);
        write_config(&drive, BOTH);
        near(drive.speed(&default), SCALE * speed_mps(t - AHEAD_S), of);
        // The option replaces the file's value, and is not added to it.
        near(drive.speed(&ahead(0.1)), SCALE * speed_mps(t - 0.1), of);
        near(drive.speed(&ahead(0.0)), SCALE * speed_mps(t), of);
        let dataset = open(&drive.path, &default);
        near(dataset.camera_ahead_s(), AHEAD_S, of);
        // The motion changes accordingly, and the intervals between frames do not.
        let frames = dataset.frames();
        let [from, to] = [1, 0].map(|before| frames[drive.frame - before].time_s.unwrap());
        let motion = dataset.track().unwrap().motion(from, to).unwrap();
        let middle = SCALE * speed_mps(t - AHEAD_S - 0.5 * (to - from));
        near(motion.distance_m, middle * (to - from), of);
        let seen = inspect(&drive.path).unwrap();
        near(seen.drives[0].camera_ahead_s, AHEAD_S, of);
        assert!(
            seen.to_string().contains("camera ahead by 200 ms"),
            "{of}: {seen}"
        );
    }
}

#[test]
fn a_converted_recording_is_not_corrected_again() {
    for drive in drives() {
        write_config(&drive, BOTH);
        let first = open(&drive.path, &OpenOptions::default());
        let expected = first.frames()[drive.frame].speed_mps.unwrap();
        let out = tempfile::tempdir().unwrap();
        let kitti = out.path().join("kitti");
        let one = std::slice::from_ref(&first);
        let folders = convert_to_kitti(one, &kitti, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let bag = out.path().join("again.bag");
        convert_to_bag(&first, &bag, Compression::None, &mut |_, _| {
            ControlFlow::Continue(())
        })
        .unwrap();
        for path in [&folders.paths[0], &bag] {
            let again = open(path, &OpenOptions::default());
            near(again.camera_ahead_s(), 0.0, drive.layout);
            let speed = again.frames()[drive.frame].speed_mps.unwrap();
            assert!(
                (speed - expected).abs() < 1e-3,
                "{}: {speed}, {expected}",
                drive.layout
            );
        }
    }
}

#[test]
fn a_dates_file_applies_to_its_drives_but_a_drives_own_takes_precedence() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let date = drive.parent().unwrap().join("dataset.toml");
    fs::write(&date, "vehicle.speed_scale = 0.5\n").unwrap();
    let speed = || open(&drive, &OpenOptions::default()).frames()[5].speed_mps;
    assert_eq!(speed(), Some(5.0));
    // Keys missing from the drive's own file come from the date's.
    fs::write(drive.join("dataset.toml"), "simulated = true\n").unwrap();
    assert_eq!(speed(), Some(5.0));
    fs::write(drive.join("dataset.toml"), "vehicle.speed_scale = 0.75\n").unwrap();
    assert_eq!(speed(), Some(7.5));
    // The length of the path from OXTS agrees with the speeds.
    let paths = open(&drive, &OpenOptions::default())
        .camera_paths()
        .unwrap();
    let (first, last) = (&paths[0].world_from_cam[0], &paths[0].world_from_cam[7]);
    let way = (last.translation() - first.translation()).norm();
    assert!((way - 7.0 * 0.103 * 7.5).abs() < 1e-6, "{way}");
}

#[test]
fn errors_name_the_file_with_an_invalid_clock_or_scale() {
    for drive in drives() {
        for (text, problem) in [
            (
                "clock.camera_ahead_s = nan\n",
                "clock.camera_ahead_s is NaN",
            ),
            ("vehicle.speed_scale = 3.6\n", "vehicle.speed_scale is 3.6"),
            ("clock.ahead = 1.0\n", "unknown field `ahead`"),
        ] {
            write_config(&drive, text);
            let error = Dataset::open(&drive.path, &OpenOptions::default()).unwrap_err();
            let file = drive.config.file_name().unwrap().to_str().unwrap();
            let text = error.to_string();
            assert!(
                text.contains(file) && text.contains(problem),
                "{}: {text}",
                drive.layout
            );
            assert!(error.hint().is_some());
        }
    }
}

/// A clock that counts from the video's start, with a speed signal that started before it.
#[test]
fn times_before_1970_are_shifted_not_clamped() {
    let root = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..8).map(|n| format!("{n:06}")).collect();
    folder::write_images(
        root.path(),
        &names.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    fs::write(root.path().join("intrinsics.txt"), "36 36 30.5 8.6\n").unwrap();
    let mut frames = "time_s,file\n".to_owned();
    for (n, name) in names.iter().enumerate() {
        frames += &format!("{:.3},{name}.png\n", -0.25 + 0.1 * n as f64);
    }
    fs::write(root.path().join("frames.csv"), frames).unwrap();
    let mut table = "time_s,speed_mps,yaw_rate_radps\n".to_owned();
    for n in 0..30 {
        let t = -1.5 + 0.1 * f64::from(n);
        table += &format!("{t:.3},{},0.0\n", speed_mps(t));
    }
    fs::write(root.path().join("speed.csv"), table).unwrap();
    let first = open(root.path(), &OpenOptions::default());
    let out = tempfile::tempdir().unwrap();
    let bag = out.path().join("drive.bag");
    let written = convert_to_bag(&first, &bag, Compression::None, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(written.moved_s, 2, "the first speed is 1.5 s before 0");
    let kitti = out.path().join("kitti");
    let written = convert_to_kitti(std::slice::from_ref(&first), &kitti, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(written.moved_s, 2);
    for path in [&bag, &written.paths[0]] {
        let again = open(path, &OpenOptions::default());
        assert_eq!(again.frames().len(), 8, "{}", path.display());
        for (a, b) in again.frames().iter().zip(first.frames()) {
            let (a_s, b_s) = (a.time_s.unwrap(), b.time_s.unwrap());
            assert!((a_s - b_s).abs() < 1e-6, "{}: {a_s}, {b_s}", path.display());
            let (a, b) = (a.speed_mps.unwrap(), b.speed_mps.unwrap());
            assert!((a - b).abs() < 1e-3, "{}: {a}, {b}", path.display());
        }
    }
}
