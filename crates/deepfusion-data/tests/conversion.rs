//! Conversions that fail or are stopped, and the next attempt; and what conversions must preserve.

use crate::common::{DRIVE, TinyDrive, folder};
use deepfusion_data::{Dataset, Error, OpenOptions, convert_to_bag, convert_to_kitti};
use deepfusion_fs::PartialFolder;
use deepfusion_hint::Hint;
use deepfusion_rosbag::Compression;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// More frames than in one batch.
fn drive(root: &Path) -> Dataset {
    let drive = TinyDrive {
        frames: (0..12).collect(),
        lines: 12,
        ..TinyDrive::default()
    };
    let folder = drive.write(root);
    let options = OpenOptions::default();
    Dataset::open(&folder, &options).unwrap().remove(0)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Converts a whole drive.
fn convert(dataset: Dataset, out: &Path) {
    let written = convert_to_kitti(&[dataset], out, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!(names(out).len(), 1, "{:?}", names(out));
    let again = Dataset::open(out, &OpenOptions::default()).unwrap();
    assert_eq!(again[0].frames().len(), 12);
    assert!(written.paths[0].starts_with(out) && written.paths[0].is_dir());
}

#[test]
fn a_failed_conversion_leaves_nothing() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let dataset = drive(root);
    let image = root.join(DRIVE).join("image_02/data/0000000010.png");
    let original = fs::read(&image).unwrap();
    fs::write(&image, "broken").unwrap();
    let (new, empty) = (root.join("new"), root.join("empty"));
    fs::create_dir(&empty).unwrap();
    for out in [&new, &empty] {
        let mut done = Vec::new();
        let failed = convert_to_kitti(std::slice::from_ref(&dataset), out, &mut |frames, _| {
            done.push(frames);
            ControlFlow::Continue(())
        });
        let message = failed.unwrap_err().to_string();
        assert!(message.contains("0000000010.png"), "{message}");
        assert_eq!(done, [8], "it failed after its first frames");
    }
    assert!(!new.exists() && names(&empty).is_empty());
    fs::write(&image, original).unwrap();
    convert(dataset, &new);
}

#[test]
fn the_remains_of_a_killed_conversion_are_removed_but_not_those_of_a_running_one() {
    let root = tempfile::tempdir().unwrap();
    let dataset = drive(&root.path().join("drive"));
    let out = root.path().join("kitti");
    let another = PartialFolder::beside(&out.join("2030_01_02")).unwrap();
    // The remains of another date are removed too.
    let left = PartialFolder::beside(&out.join("2011_09_27")).unwrap();
    let folder = left.path().to_owned();
    fs::create_dir(folder.join("2011_09_27_drive_0001_sync")).unwrap();
    left.abandon();
    let refused = convert_to_kitti(std::slice::from_ref(&dataset), &out, &mut |_, _| {
        ControlFlow::Continue(())
    });
    let refused = refused.unwrap_err();
    assert!(refused.hint().unwrap().contains(".lock"), "{refused}");
    assert!(matches!(refused, Error::Unfinished(found) if found.path == another.path()));
    assert!(another.path().exists() && !folder.exists());
    drop(another);
    convert(dataset, &out);
}

#[test]
fn a_stopped_conversion_leaves_nothing_unless_all_frames_are_done() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let dataset = drive(root);
    let (kitti, bag) = (root.join("new/kitti"), root.join("drive.bag"));
    // Stopped after the first frames, or after the last.
    for (frames, is_done) in [(8, false), (12, true)] {
        let mut stop_at = |done: usize, total: usize| {
            assert_eq!(total, 12);
            if done >= frames {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let of_kitti = convert_to_kitti(std::slice::from_ref(&dataset), &kitti, &mut stop_at);
        let of_bag = convert_to_bag(&dataset, &bag, Compression::None, &mut stop_at);
        for written in [of_kitti, of_bag] {
            if is_done {
                written.unwrap();
                continue;
            }
            let stopped = written.unwrap_err();
            assert!(stopped.hint().is_some());
            assert!(
                matches!(stopped, Error::Stopped { done: 8, total: 12 }),
                "{stopped}"
            );
        }
        assert_eq!(root.join("new").exists(), is_done);
        let beside = names(root).iter().filter(|n| n.contains("drive.")).count();
        assert_eq!(beside, if is_done { 2 } else { 0 }, "{:?}", names(root));
    }
    let options = OpenOptions::default();
    for path in [&kitti, &bag] {
        assert_eq!(Dataset::open(path, &options).unwrap()[0].frames().len(), 12);
    }
}

fn kitti_of(dataset: &Dataset, out: &Path) -> Dataset {
    let dataset = std::slice::from_ref(dataset);
    convert_to_kitti(dataset, out, &mut |_, _| ControlFlow::Continue(())).unwrap();
    Dataset::open(out, &OpenOptions::default())
        .unwrap()
        .remove(0)
}

/// Packets have zeros for unmeasured values: without a mark, a copy of a drive without a yaw rate would go straight through every bend.
#[test]
fn unmeasured_values_stay_unknown_in_the_copy() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let folder = root.join("folder");
    folder::write_drive(&folder, 6, 5.0, 0.1);
    let open = || {
        Dataset::open(&folder, &OpenOptions::default())
            .unwrap()
            .remove(0)
    };
    let turns = kitti_of(&open(), &root.join("turns"));
    assert!(turns.yaw_known() && turns.tilt_unknown());
    let ahead: String = (0..6).fold("time_s,speed_mps\n".to_owned(), |table, n| {
        table + &format!("{:.3},5\n", 0.349 + 0.103 * f64::from(n))
    });
    fs::write(folder.join("speed.csv"), ahead).unwrap();
    let dataset = open();
    assert!(!dataset.yaw_known());
    let copy = kitti_of(&dataset, &root.join("ahead"));
    assert!(!copy.yaw_known() && copy.tilt_unknown());
    assert!(copy.frames()[2].speed_mps.is_some());
    let warned: Vec<String> = copy.warnings().iter().map(ToString::to_string).collect();
    assert!(
        warned.iter().any(|w| w.contains("yaw_known = false")),
        "{warned:?}"
    );
    // In KITTI's own drives all of it was measured, also in their copies.
    let own = kitti_of(&drive(&root.join("drive")), &root.join("own"));
    assert!(own.yaw_known() && !own.tilt_unknown());
}

/// KITTI writes an empty line for a frame without a time.
#[test]
fn a_frame_without_a_time_has_none_in_the_copy() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let _ = drive(&root.join("drive"));
    let times = root
        .join("drive")
        .join(DRIVE)
        .join("image_02/timestamps.txt");
    let text = fs::read_to_string(&times).unwrap();
    let lines = text.lines().enumerate();
    let lines: Vec<&str> = lines
        .map(|(n, line)| if n == 4 { "" } else { line })
        .collect();
    fs::write(&times, lines.join("\n")).unwrap();
    let folder = root.join("drive").join(DRIVE);
    let dataset = Dataset::open(&folder, &OpenOptions::default())
        .unwrap()
        .remove(0);
    let timed =
        |of: &Dataset| -> Vec<bool> { of.frames().iter().map(|f| f.time_s.is_some()).collect() };
    assert_eq!(timed(&dataset).iter().filter(|timed| !**timed).count(), 1);
    let copy = kitti_of(&dataset, &root.join("copy"));
    assert_eq!(timed(&copy), timed(&dataset));
}

/// Names such as 20240101120000.png: a line for every number would not fit on any disk.
#[test]
fn frames_with_dates_as_numbers_are_renumbered() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let names = ["20240101120000", "20240101120001", "20240101120007"];
    for timed in [false, true] {
        let folder = root.join(format!("folder-{timed}"));
        folder::write_images(&folder, &names);
        fs::write(folder.join("intrinsics.txt"), "36 36 30.5 8.6\n").unwrap();
        if timed {
            let table = format!(
                "time_s,file\n0,{}.png\n1,{}.png\n7,{}.png\n",
                names[0], names[1], names[2]
            );
            fs::write(folder.join("frames.csv"), table).unwrap();
        }
        let dataset = Dataset::open(&folder, &OpenOptions::default())
            .unwrap()
            .remove(0);
        let copy = kitti_of(&dataset, &root.join(format!("copy-{timed}")));
        let numbers: Vec<u64> = copy.frames().iter().map(|f| f.number).collect();
        assert_eq!(numbers, [0, 1, 3]);
        let times: Vec<Option<f64>> = copy.frames().iter().map(|f| f.time_s).collect();
        let expected = [0.0, 1.0, 7.0].map(|s| timed.then_some(s));
        assert_eq!(times, expected);
    }
}

/// An error must not name the temporary folder, which no longer exists.
#[test]
fn write_errors_name_the_final_path() {
    let root = tempfile::tempdir().unwrap();
    let dataset = drive(&root.path().join("drive"));
    let out = root.path().join("kitti");
    let failed = convert_to_kitti(std::slice::from_ref(&dataset), &out, &mut |_, _| {
        let aside = names(&out).into_iter().find(|n| n.ends_with(".partial"));
        fs::remove_dir_all(out.join(aside.unwrap())).unwrap();
        ControlFlow::Continue(())
    });
    let message = failed.unwrap_err().to_string();
    assert!(message.contains("_drive_0001_sync"), "{message}");
    assert!(!message.contains("partial"), "{message}");
}

fn bag_of(dataset: &Dataset, out: &Path) -> Dataset {
    let go = &mut |_, _| ControlFlow::Continue(());
    convert_to_bag(dataset, out, Compression::None, go).unwrap();
    let options = OpenOptions::default();
    Dataset::open(out, &options).unwrap().remove(0)
}

/// Frames on both sides of a pause are not neighbours, in a bag and in files with numbers.
#[test]
fn missing_frames_leave_out_their_numbers_in_a_bag() {
    let root = tempfile::tempdir().unwrap();
    let numbers: Vec<u64> = (0..5).chain(9..12).collect();
    let drive = TinyDrive {
        frames: numbers.clone(),
        lines: 12,
        ..TinyDrive::default()
    };
    let folder = drive.write(&root.path().join("drive"));
    let options = OpenOptions::default();
    let dataset = Dataset::open(&folder, &options).unwrap().remove(0);
    let bag = bag_of(&dataset, &root.path().join("drive.bag"));
    let found: Vec<u64> = bag.frames().iter().map(|f| f.number).collect();
    assert_eq!(found, numbers);
    for frame in 0..numbers.len() {
        let images = [&dataset, &bag].map(|of| of.load_image(frame).unwrap());
        assert!(images[0] == images[1], "frame {frame}");
    }
}

/// An assumed mount must stay marked as assumed in a copy, or it would never be [aimed](Dataset::aim).
#[test]
fn an_assumed_mount_stays_assumed_in_the_copy() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let folder = root.join("folder");
    folder::write_drive(&folder, 6, 5.0, 0.1);
    for (mount, assumed) in [("", true), ("[mount]\nup_m = 1.5\n", false)] {
        fs::write(folder.join("dataset.toml"), mount).unwrap();
        let options = OpenOptions::default();
        let dataset = Dataset::open(&folder, &options).unwrap().remove(0);
        let copies = [
            kitti_of(&dataset, &root.join(format!("kitti-{assumed}"))),
            bag_of(&dataset, &root.join(format!("{assumed}.bag"))),
        ];
        assert_eq!(dataset.mount_assumed(), assumed);
        for copy in copies {
            assert_eq!(copy.mount_assumed(), assumed);
            let (own, copied) = (dataset.cam_from_vehicle(), copy.cam_from_vehicle());
            let apart = own.unwrap().inverse() * copied.unwrap();
            assert!(apart.translation().norm() < 1e-9 && apart.angle() < 1e-9);
            let warnings: Vec<String> = copy.warnings().iter().map(ToString::to_string).collect();
            assert_eq!(
                warnings
                    .iter()
                    .any(|w| w.contains("it looks straight ahead")),
                assumed,
                "{warnings:?}"
            );
        }
    }
}

/// Packets only at the frames of a camera with one image per second would be too far apart for the vehicle's motion.
#[test]
fn a_slow_camera_keeps_the_motion_between_its_frames() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let folder = root.join("folder");
    folder::write_images(&folder, &["a", "b", "c", "d"]);
    fs::write(folder.join("intrinsics.txt"), "36 36 30.5 8.6\n").unwrap();
    let frames = "time_s,file\n10.0,a.png\n11.0,b.png\n12.0,c.png\n13.0,d.png\n";
    fs::write(folder.join("frames.csv"), frames).unwrap();
    let speeds: String = (0..35).fold(
        "time_s,speed_mps,yaw_rate_radps\n".to_owned(),
        |table, n| {
            let time_s = 9.8 + 0.1 * f64::from(n);
            table + &format!("{time_s:.1},{:.2},0.1\n", 5.0 + 0.1 * f64::from(n))
        },
    );
    fs::write(folder.join("speed.csv"), speeds).unwrap();
    let options = OpenOptions::default();
    let dataset = Dataset::open(&folder, &options).unwrap().remove(0);
    let copy = kitti_of(&dataset, &root.join("kitti"));
    for frame in 0..3 {
        let moved = [&dataset, &copy].map(|of| of.camera_motion(frame, frame + 1).unwrap());
        let apart = moved[0].inverse() * moved[1];
        assert!(moved[0].translation().norm() > 4.0);
        assert!(
            apart.translation().norm() < 0.01 && apart.angle() < 0.001,
            "{apart:?}"
        );
    }
}
