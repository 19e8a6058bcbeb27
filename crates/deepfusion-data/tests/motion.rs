//! Snippets and ego-motion, on drives written here and on KITTI's.

use crate::common::{self, TinyDrive, packet};
use deepfusion_data::{Cameras, Dataset, Error, OpenOptions, Snippet, Split, hold_out};
use deepfusion_hint::Hint;
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

fn open(path: &Path) -> Dataset {
    let mut all = Dataset::open(path, &OpenOptions::default()).unwrap();
    assert_eq!(all.len(), 1);
    all.remove(0)
}

fn numbers(dataset: &Dataset, snippets: &[Snippet]) -> Vec<u64> {
    let frames = dataset.frames();
    snippets.iter().map(|s| frames[s.target].number).collect()
}

#[test]
fn driving_straight_moves_the_camera_by_speed_times_real_time() {
    let root = tempfile::tempdir().unwrap();
    let dataset = open(&TinyDrive::default().write(root.path()));
    let snippets = dataset.snippets(&[-1, 1], 0.5).unwrap();
    assert_eq!(numbers(&dataset, &snippets), [1, 2, 3, 4, 5, 6]);
    for snippet in &snippets {
        let [before, after] = [&snippet.sources[0], &snippet.sources[1]];
        assert_eq!((before.offset, after.offset), (-1, 1));
        assert_eq!(
            (before.frame + 1, after.frame),
            (snippet.target, snippet.target + 1)
        );
        for source in [before, after] {
            let motion = source.motion;
            assert!((motion.dt_s - 0.103).abs() < 1e-9);
            assert!(
                (motion.distance_m - 1.03).abs() < 1e-8,
                "{}",
                motion.distance_m
            );
            assert!((motion.speed_mps - 10.0).abs() < 1e-9);
            // The camera's +z is forward: the world is nearer in the following frame.
            let z = motion.source_from_target.unwrap().translation().z;
            let expected = -1.03 * f64::from(source.offset);
            assert!((z - expected).abs() < 1e-3, "{z}");
        }
    }
    assert_eq!(dataset.frames()[3].speed_mps, Some(10.0));
}

#[test]
fn in_a_turn_the_lever_arm_counts_and_both_directions_are_inverse() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        yaw_rate_radps: 0.6,
        speed_mps: 2.0,
        ..TinyDrive::default()
    };
    let dataset = open(&drive.write(root.path()));
    let forward = dataset.snippets(&[1], 0.5).unwrap();
    let backward = dataset.snippets(&[-1], 0.5).unwrap();
    let frame1_from_frame0 = forward[0].sources[0].motion.source_from_target.unwrap();
    let frame0_from_frame1 = backward[0].sources[0].motion.source_from_target.unwrap();
    let both = frame1_from_frame0 * frame0_from_frame1;
    assert!(both.translation().norm() < 1e-9 && both.angle() < 1e-9);
    // When turning left, the later camera looks further to the left, so the world moves to the right in it (x increases).
    let seen = frame1_from_frame0.rotate(&Vector3::z());
    assert!((seen.x - (0.6_f64 * 0.103).sin()).abs() < 1e-3, "{seen}");
    // The arc of the IMU, computed by hand: the camera is about 1.08 m ahead of it and swings out by θ times that.
    let (d, theta) = (0.206_f64, 0.0618_f64);
    let place = dataset.cam_from_vehicle().unwrap().inverse().translation();
    let chord = d * (theta / 2.0).sin() / (theta / 2.0);
    let at = |p: Vector3<f64>| {
        let (c, s) = (theta.cos(), theta.sin());
        Vector3::new(c * p.x - s * p.y, s * p.x + c * p.y, p.z)
            + Vector3::new(
                chord * (theta / 2.0).cos(),
                chord * (theta / 2.0).sin(),
                0.0,
            )
    };
    let distance = forward[0].sources[0].motion.distance_m;
    let by_hand = (at(place) - place).norm();
    assert!((distance - by_hand).abs() < 1e-6, "{distance} {by_hand}");
    assert!(
        (by_hand - d).abs() > 1e-3,
        "the lever arm makes a difference"
    );
}

#[test]
fn missing_frames_break_pairs() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        frames: vec![0, 1, 3, 4, 5, 7],
        ..TinyDrive::default()
    };
    let dataset = open(&drive.write(root.path()));
    let pairs = dataset.snippets(&[1], 0.5).unwrap();
    assert_eq!(numbers(&dataset, &pairs), [0, 3, 4]);
    assert!(pairs.iter().all(|s| s.sources[0].frame == s.target + 1));
    let triples = dataset.snippets(&[-1, 1], 0.5).unwrap();
    assert_eq!(numbers(&dataset, &triples), [4]);
}

#[test]
fn sources_are_at_least_the_requested_distance_away() {
    let root = tempfile::tempdir().unwrap();
    let dataset = open(&TinyDrive::default().write(root.path()));
    let next = dataset.snippets(&[1], 0.5).unwrap();
    let step = next[0].sources[0].motion.distance_m;
    // Frames are farther apart than this distance, so it has no effect.
    let near = dataset.snippets_apart(&[1], 0.5 * step, 0.5).unwrap();
    assert_eq!(near, next);
    for (offset, expected) in [(1, 2), (-1, -2), (2, 3)] {
        let least = 1.3 * step * f64::from(offset).abs();
        let apart = dataset.snippets_apart(&[offset], 1.3 * step, 0.5).unwrap();
        assert!(!apart.is_empty());
        for snippet in &apart {
            let [source] = snippet.sources[..] else {
                panic!("{snippet:?}");
            };
            assert_eq!(source.offset, expected, "{snippet:?}");
            let frame = snippet.target as i64 + i64::from(expected);
            assert_eq!(source.frame as i64, frame);
            assert!(source.motion.distance_m >= least, "{snippet:?}");
        }
    }
    // A distance longer than the whole drive leaves no pair, and the error names it.
    let error = dataset.snippets_apart(&[1], 1000.0, 0.5).unwrap_err();
    assert!(error.to_string().contains("[1], 1000 m a step"), "{error}");
    assert!(error.hint().unwrap().contains("frame_distance_m"));
}

#[test]
fn standing_pairs_are_dropped_and_a_standing_vehicle_is_an_error() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    // Packets are 4 ms later than images, so the pair (0, 1) still includes a little of packet 2's speed.
    for n in 0..4 {
        fs::write(
            drive.join(format!("oxts/data/{n:010}.txt")),
            packet(0.1, 0.0),
        )
        .unwrap();
    }
    let dataset = open(&drive);
    let kept = dataset.snippets(&[1], 0.5).unwrap();
    assert_eq!(numbers(&dataset, &kept), [3, 4, 5, 6]);
    for n in 4..8 {
        fs::write(
            drive.join(format!("oxts/data/{n:010}.txt")),
            packet(0.1, 0.0),
        )
        .unwrap();
    }
    let error = open(&drive).snippets(&[1], 0.5).unwrap_err();
    assert!(matches!(error, Error::Standing { pairs: 7, .. }), "{error}");
    assert!(
        error.to_string().contains("the vehicle stands still"),
        "{error}"
    );
    assert!(error.hint().is_some());
}

#[test]
fn a_drive_with_one_frame_is_an_error() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        frames: vec![5],
        ..TinyDrive::default()
    };
    let dataset = open(&drive.write(root.path()));
    let error = dataset.snippets(&[1], 0.5).unwrap_err();
    assert!(matches!(error, Error::OneFrame { frame: 5, .. }), "{error}");
}

#[test]
fn errors_name_what_is_missing_for_ego_motion() {
    for part in [
        "image_02/timestamps.txt",
        "oxts/timestamps.txt",
        "oxts/data",
        "oxts",
        "../calib_imu_to_velo.txt",
        "../calib_velo_to_cam.txt",
    ] {
        let root = tempfile::tempdir().unwrap();
        let drive = TinyDrive::default().write(root.path());
        let path = drive.join(part);
        if path.is_dir() {
            fs::remove_dir_all(&path).unwrap();
        } else {
            fs::remove_file(&path).unwrap();
        }
        // Opening succeeds, which is enough for evaluation; only training needs the part.
        let dataset = open(&drive);
        let error = dataset.snippets(&[1], 0.5).unwrap_err();
        assert!(matches!(error, Error::Missing { .. }), "{part}: {error}");
        let name = Path::new(part).file_name().unwrap().to_str().unwrap();
        assert!(error.to_string().contains(name), "{part}: {error}");
        assert!(error.hint().is_some());
    }
}

#[test]
fn pairs_without_nearby_oxts_are_dropped() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        frames: (0..20).collect(),
        lines: 20,
        ..TinyDrive::default()
    }
    .write(root.path());
    for n in 6..13 {
        fs::remove_file(drive.join(format!("oxts/data/{n:010}.txt"))).unwrap();
    }
    let dataset = open(&drive);
    let numbers = numbers(&dataset, &dataset.snippets(&[1], 0.5).unwrap());
    // Image 13 is 4 ms before packet 13, still within the gap.
    assert_eq!(numbers, [0, 1, 2, 3, 4, 14, 15, 16, 17, 18]);
    for n in (0..6).chain(13..20) {
        fs::remove_file(drive.join(format!("oxts/data/{n:010}.txt"))).unwrap();
    }
    let all_gone = open(&drive).snippets(&[1], 0.5).unwrap_err();
    assert!(matches!(all_gone, Error::Missing { .. }), "{all_gone}");
}

#[test]
fn bad_offsets_are_refused() {
    let root = tempfile::tempdir().unwrap();
    let dataset = open(&TinyDrive::default().write(root.path()));
    for offsets in [&[][..], &[0], &[1, 1]] {
        let error = dataset.snippets(offsets, 0.5).unwrap_err();
        assert!(matches!(error, Error::Offsets { .. }), "{error}");
    }
    let error = dataset.snippets(&[i32::MIN], 0.5).unwrap_err();
    assert!(
        matches!(
            error,
            Error::NoPairs {
                no_neighbour: 8,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn a_split_selects_targets_but_not_their_neighbours() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        cameras: vec![2, 3],
        ..TinyDrive::default()
    };
    let folder = drive.write(root.path());
    let file = root.path().join("split.txt");
    let name = common::DRIVE;
    fs::write(
        &file,
        format!("{name} 0000000005 l\n{name} 2 l\n{name} 99 l\n{name} 3 r\nother/drive 1 l\n"),
    )
    .unwrap();
    let split = Split::read(&file).unwrap();
    let open = |camera| {
        let split = Some(split.clone());
        Dataset::open(
            root.path(),
            &OpenOptions {
                camera,
                split,
                ..OpenOptions::default()
            },
        )
        .unwrap()
    };
    let left = open(Cameras::Left);
    // Five distinct frames, of which the right camera's and two that do not exist are not in the opened data sets.
    let coverage = split.coverage(&left);
    assert_eq!((coverage.expected, coverage.found), (5, 2));
    let first = coverage.first_missing.clone().unwrap();
    assert_eq!(first, format!("{name} 99 l"));
    assert!(!coverage.is_complete());
    assert_eq!(split.coverage(&open(Cameras::Both)).found, 3);
    assert_eq!(left[0].frames().len(), 8);
    assert_eq!(left[0].selected(), [2, 5]);
    let pairs = left[0].snippets(&[-1, 1], 0.5).unwrap();
    assert_eq!(numbers(&left[0], &pairs), [2, 5]);
    assert_eq!(
        split.locate(&left),
        [(0, 5), (0, 2)],
        "in the split's order"
    );

    let both = open(Cameras::Both);
    assert_eq!(both.len(), 2);
    assert_eq!(both[1].selected(), [3]);
    assert_eq!(split.locate(&both), [(0, 5), (0, 2), (1, 3)]);

    fs::write(&file, "2011_09_26/2011_09_26_drive_0001_sync 3 l\n").unwrap();
    let split = Some(Split::read(&file).unwrap());
    let camera = Cameras::Left;
    let error = Dataset::open(
        &folder,
        &OpenOptions {
            camera,
            split,
            ..OpenOptions::default()
        },
    )
    .unwrap_err();
    assert!(
        matches!(error, Error::SplitSelectsNothing { entries: 1, .. }),
        "{error}"
    );
}

#[test]
fn the_last_tenth_is_held_out_and_shares_no_frame() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        frames: (0..41).collect(),
        lines: 41,
        ..TinyDrive::default()
    };
    let dataset = open(&drive.write(root.path()));
    let snippets = dataset.snippets(&[1], 0.5).unwrap();
    let (train, validation) = hold_out(snippets.clone(), 0.1);
    assert_eq!(numbers(&dataset, &validation), [36, 37, 38, 39]);
    // Pair (35, 36) shares frame 36 with the first one held out.
    assert_eq!(numbers(&dataset, &train), (0..35).collect::<Vec<_>>());
    let (train, validation) = hold_out(snippets[..1].to_vec(), 0.1);
    assert_eq!((train.len(), validation.len()), (1, 0));
    let (train, validation) = hold_out(snippets[..2].to_vec(), 0.1);
    assert_eq!((train.len(), validation.len()), (1, 1));
}

/// Distances of the real drives, by `numpy.trapezoid` over oxts samples and interpolated image times: 71.302
/// and 54.628 m (the GPS paths are 69.4 and 54.9 m). The camera's own path differs by the lever arm in turns.
#[test]
fn real_drives_have_their_length() {
    for (drive, pairs, speed_integral) in [
        ("2011_09_26_drive_0005_sync", 153, 71.302),
        ("2011_09_26_drive_0009_sync", 50, 54.628),
    ] {
        let Some(path) = common::real_data(&format!("kitti_raw/2011_09_26/{drive}")) else {
            return;
        };
        let dataset = open(&path);
        let snippets = dataset.snippets(&[1], 0.5).unwrap();
        assert_eq!(snippets.len(), pairs);
        let motions = || snippets.iter().map(|s| s.sources[0].motion);
        let driven: f64 = motions().map(|m| m.speed_mps * m.dt_s).sum();
        assert!((driven - speed_integral).abs() < 0.001, "{drive}: {driven}");
        let moved: f64 = motions().map(|m| m.distance_m).sum();
        assert!((moved / driven - 1.0).abs() < 0.03, "{drive}: {moved}");
        for m in motions() {
            let t = m.source_from_target.unwrap().translation();
            assert!(t.z < -0.95 * m.distance_m, "{drive}: ahead is -z, {t}");
        }
    }
}
