//! A written drive is a KITTI drive: the project's own reader opens it and finds the same ground truth.

use deepfusion_data::{Dataset, GtKind, OpenOptions, load_rgb, read_depth_png};
use deepfusion_fs::PartialFolder;
use deepfusion_hint::Hint;
use deepfusion_sim::{Error, SimConfig, Simulation, write_kitti};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

fn small(frames: usize) -> Simulation {
    let config = SimConfig {
        seed: 12,
        frames,
        width: 320,
        height: 96,
        moving_cars: 3,
        scan_every: 2,
        ..SimConfig::default()
    };
    Simulation::new(&config).expect("a valid configuration")
}

#[test]
fn the_reader_finds_the_ground_truth_of_the_simulator() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("new/drive");
    let simulation = small(6);
    let mut calls = Vec::new();
    let drive = write_kitti(&simulation, &out, &mut |done, all| {
        calls.push((done, all));
        ControlFlow::Continue(())
    })
    .expect("the drive is written");
    assert_eq!(drive, out.join("2026_01_01/2026_01_01_drive_0012_sync"));
    assert_eq!(calls.last(), Some(&(6, 6)));

    let sets = Dataset::open(&out, &OpenOptions::default()).expect("the reader opens it");
    let [set] = &sets[..] else {
        panic!("{} drives", sets.len())
    };
    assert_eq!(set.frames().len(), 6);
    let (read, k) = (set.intrinsics(0), simulation.intrinsics());
    assert_eq!((read.width, read.height), (k.width, k.height));
    for (a, b) in [
        (read.fx, k.fx),
        (read.fy, k.fy),
        (read.cx, k.cx),
        (read.cy, k.cy),
    ] {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
    for (i, frame) in set.frames().iter().enumerate() {
        assert!((frame.time_s.expect("a time stamp") - simulation.time_s(i)).abs() < 1e-8);
        let speed = frame.speed_mps.expect("a speed");
        assert!((speed - simulation.frame(i).speed_mps).abs() < 1e-9);
        let image = load_rgb(frame.image.path()).expect("the picture");
        assert_eq!(image.as_raw(), simulation.frame(i).rgb.as_raw());
    }

    // The reader's ego-motion, from OXTS through the calibration, is the true one.
    let snippets = set.snippets(&[1], 0.5).expect("moving pairs");
    assert_eq!(snippets.len(), 5);
    for snippet in &snippets {
        let motion = &snippet.sources[0].motion;
        let (target, source) = (snippet.target, snippet.sources[0].frame);
        let truth = simulation.world_from_cam(source).inverse() * simulation.world_from_cam(target);
        let distance = truth.translation().norm();
        assert!(
            (motion.distance_m / distance - 1.0).abs() < 0.02,
            "{motion:?} {distance}"
        );
        let error = motion.source_from_target.expect("oxts has yaw rates") * truth.inverse();
        assert!(error.angle() < 0.004, "{}", error.angle());
        assert!(error.translation().norm() < 0.02 * distance + 0.01);
    }

    // The dense depth is exact to its resolution of 1/256 m, and the scans agree with it.
    let stored = drive.join("proj_depth/groundtruth/image_02/0000000002.png");
    let stored = read_depth_png(&stored).expect("the depth");
    let frame = simulation.frame(2);
    for (a, b) in stored.data.iter().zip(&frame.depth.data) {
        assert!((a - b).abs() <= 0.5 / 256.0 + 1e-5 || (*a == 0.0 && *b > 255.9));
    }
    let sparse = set
        .ground_truth(2, GtKind::Z)
        .expect("readable")
        .expect("frame 2 has a scan");
    let (mut agree, mut all) = (0u32, 0u32);
    for (scan, dense) in sparse.data.iter().zip(&frame.depth.data) {
        if *scan > 0.0 && *dense > 0.0 {
            all += 1;
            agree += u32::from((scan - dense).abs() < 0.2 + 0.04 * dense);
        }
    }
    assert!(all > 2000 && agree * 10 > all * 9, "{agree} of {all}");
    assert!(set.ground_truth(1, GtKind::Z).expect("readable").is_none());

    let poses = fs::read_to_string(drive.join("poses.txt")).expect("poses");
    assert_eq!(poses.lines().count(), 6);
    assert!(poses.lines().all(|line| line.split(' ').count() == 12));
    assert!(drive.join("moving_02/0000000005.png").exists());
    assert_eq!(leftovers(&out), 0);
}

/// Number of temporary files and folders anywhere below `folder`.
fn leftovers(folder: &Path) -> usize {
    fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| {
            let path = entry.expect("an entry").path();
            let own = usize::from(path.to_string_lossy().contains("partial"));
            own + if path.is_dir() { leftovers(&path) } else { 0 }
        })
        .sum()
}

#[test]
fn equal_configurations_write_equal_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str| {
        write_kitti(&small(2), &folder.path().join(name), &mut |_, _| {
            ControlFlow::Continue(())
        })
        .expect("written")
    };
    let (a, b) = (write("a"), write("b"));
    for file in [
        "image_02/data/0000000001.png",
        "proj_depth/groundtruth/image_02/0000000001.png",
        "velodyne_points/data/0000000000.bin",
        "oxts/data/0000000001.txt",
        "poses.txt",
    ] {
        let bytes = |drive: &Path| fs::read(drive.join(file)).expect("a file");
        assert_eq!(bytes(&a), bytes(&b), "{file}");
    }
}

#[test]
fn a_folder_that_is_not_empty_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("mine.txt"), "keep").expect("a file");
    let error = write_kitti(&small(1), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .expect_err("refused");
    assert!(matches!(&error, Error::OutputNotEmpty { path } if path == folder.path()));
    assert!(error.hint().is_some());
    let kept = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(kept, 1, "nothing should be added");
}

#[test]
fn an_empty_folder_is_used() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let written = write_kitti(&small(1), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    });
    written.expect("written");
}

#[test]
fn an_unwritable_path_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("a-file");
    fs::write(&file, "not a folder").expect("a file");
    for out in [file.clone(), file.join("below")] {
        let error = write_kitti(&small(1), &out, &mut |_, _| ControlFlow::Continue(()))
            .expect_err("no folder");
        assert!(error.to_string().contains("a-file"), "{error}");
        assert!(error.hint().is_some());
    }
}

/// A failure half way leaves nothing behind.
#[cfg(unix)]
#[test]
fn a_failure_half_way_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    // Another process takes the final name while the drive is being written.
    let blocked = out.join("2026_01_01/taken");
    let error = write_kitti(&small(1), &out, &mut |_, _| {
        fs::create_dir_all(&blocked).expect("a folder");
        ControlFlow::Continue(())
    })
    .expect_err("the name is taken");
    assert!(error.to_string().contains("2026_01_01"), "{error}");
    assert_eq!(leftovers(folder.path()), 0);
}

#[test]
fn a_drive_that_is_stopped_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let entries = || fs::read_dir(folder.path()).expect("the folder").count();
    for out in [folder.path().join("new"), folder.path().to_owned()] {
        let error = write_kitti(&small(9), &out, &mut |_, _| ControlFlow::Break(()))
            .expect_err("it is stopped");
        assert!(
            matches!(error, Error::Stopped { done: 8, total: 9 }),
            "{error}"
        );
        assert!(error.hint().is_some());
        assert_eq!(entries(), 0);
    }
}

#[test]
fn a_drive_stopped_at_its_last_frame_is_complete() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("new");
    let drive = write_kitti(&small(2), &out, &mut |_, _| ControlFlow::Break(()));
    let drive = drive.expect("the drive is written");
    let sets = Dataset::open(&drive, &OpenOptions::default()).expect("the reader opens it");
    assert_eq!(sets[0].frames().len(), 2);
    assert!(drive.join("tracklet_labels.xml").exists());
    assert_eq!(leftovers(&out), 0);
}

/// The error names the final path: the temporary folder is gone by then.
#[test]
fn errors_name_the_final_path() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = write_kitti(&small(9), folder.path(), &mut |_, _| {
        let mut entries = fs::read_dir(folder.path()).expect("the folder");
        let aside = entries.find_map(|entry| {
            let path = entry.expect("an entry").path();
            path.is_dir().then_some(path)
        });
        fs::remove_dir_all(aside.expect("the folder aside")).expect("it is removed");
        ControlFlow::Continue(())
    })
    .expect_err("its folders are gone");
    let message = error.to_string();
    assert!(message.contains("2026_01_01_drive_0012_sync"), "{message}");
    assert!(!message.contains("partial"), "{message}");
}

#[test]
fn the_unfinished_folder_of_another_writer_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let another = PartialFolder::beside(&folder.path().join("2026_01_01")).expect("a folder");
    let error = write_kitti(&small(1), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .expect_err("refused");
    assert!(matches!(&error, Error::Unfinished(found) if found.path == another.path()));
    assert!(error.hint().is_some());
    assert!(another.path().exists());
}

/// Files left by a killed process do not block the next one.
#[test]
fn files_of_a_killed_writer_are_removed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let left = PartialFolder::beside(&folder.path().join("2026_01_01")).expect("a folder");
    let images = left.path().join("2026_01_01_drive_0012_sync/image_02");
    fs::create_dir_all(images).expect("a folder");
    left.abandon();
    write_kitti(&small(1), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .expect("written");
    assert_eq!(leftovers(folder.path()), 0);
}
