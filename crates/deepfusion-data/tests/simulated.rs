//! The mark of a simulated recording: in every layout that has one, and after a conversion.

use crate::common::bag::{CAMERA, TinyBag};
use crate::common::folder;
use deepfusion_data::{Dataset, DatasetKind, OpenOptions, convert_to_bag, convert_to_kitti};
use deepfusion_rosbag::Compression;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn open(path: &Path) -> Vec<Dataset> {
    Dataset::open(path, &OpenOptions::default()).unwrap()
}

/// A bag of a vehicle with a speed, and with more topics.
fn bag(at: &Path, more: impl FnOnce(&mut TinyBag)) -> PathBuf {
    let path = at.join("drive.bag");
    let mut bag = TinyBag::new(&path, "/camera/image");
    bag.twist("/twist", 5.0);
    more(&mut bag);
    bag.finish();
    fs::write(path.with_extension("toml"), CAMERA).unwrap();
    path
}

fn mark(bag: &Path) {
    let text = format!("simulated = true\n{CAMERA}");
    fs::write(bag.with_extension("toml"), text).unwrap();
}

#[test]
fn conversions_keep_the_simulated_mark() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let bag = bag(root, |_| ());
    for marked in [false, true] {
        if marked {
            mark(&bag);
        }
        let kitti = root.join(format!("kitti-{marked}"));
        convert_to_kitti(&open(&bag), &kitti, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let again = root.join(format!("again-{marked}.bag"));
        let drive = open(&kitti).remove(0);
        convert_to_bag(&drive, &again, Compression::None, &mut |_, _| {
            ControlFlow::Continue(())
        })
        .unwrap();
        for path in [&bag, &kitti, &again] {
            let found = (
                open(path)[0].is_simulated(),
                Dataset::all_simulated_at(path),
            );
            assert_eq!(found, (marked, marked), "{}", path.display());
        }
    }
    assert!(!Dataset::all_simulated_at(&root.join("nowhere")));
}

/// In a date with real and simulated drives, each drive has its own mark, which is kept in another date. Drives without a mark have the
/// date's.
#[test]
fn drives_of_one_date_have_their_own_marks() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let bag = bag(root, |_| ());
    let real = open(&bag).remove(0);
    mark(&bag);
    let simulated = open(&bag).remove(0);
    let kitti = root.join("kitti");
    let converted = convert_to_kitti(&[real, simulated], &kitti, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let [of_real, of_simulated] = converted.paths.as_slice() else {
        panic!("{:?}", converted.paths)
    };
    let marks = || -> Vec<bool> { open(&kitti).iter().map(Dataset::is_simulated).collect() };
    assert_eq!(marks(), [false, true]);
    assert!(!Dataset::all_simulated_at(&kitti));
    let elsewhere = root.join(of_simulated.file_name().unwrap());
    fs::rename(of_simulated, &elsewhere).unwrap();
    assert!(Dataset::all_simulated_at(&elsewhere));
    fs::rename(&elsewhere, of_simulated).unwrap();
    let date = of_real.parent().unwrap();
    fs::write(date.join("dataset.toml"), "simulated = true\n").unwrap();
    assert_eq!(marks(), [true, true]);
    fs::write(of_real.join("dataset.toml"), "simulated = false\n").unwrap();
    assert_eq!(marks(), [false, true]);
}

/// A bag without a mark counts as simulated if it has both topics that cannot be recorded; one of them could be a better sensor's.
#[test]
fn a_bag_with_exact_motion_and_depth_is_simulated() {
    type Topics = fn(&mut TinyBag);
    let motion: Topics = |bag| {
        bag.odometry("/truth/odometry", 5.0);
    };
    let both: Topics = |bag| {
        bag.odometry("/truth/odometry", 5.0);
        bag.images("/truth/depth/compressed");
    };
    let named: Topics = |bag| {
        bag.twist("/truth/odometry", 5.0);
        bag.images("/truth/depth/compressed");
    };
    for (topics, setting, expected) in [
        (motion, "", false),
        (named, "", false),
        (both, "", true),
        (both, "simulated = false\n", false),
    ] {
        let root = tempfile::tempdir().unwrap();
        let bag = bag(root.path(), topics);
        fs::write(bag.with_extension("toml"), format!("{setting}{CAMERA}")).unwrap();
        assert_eq!(open(&bag)[0].is_simulated(), expected, "{setting}");
    }
}

#[test]
fn dataset_toml_marks_a_folder_as_simulated() {
    let root = tempfile::tempdir().unwrap();
    folder::write_drive(root.path(), 4, 5.0, 0.0);
    assert!(!open(root.path())[0].is_simulated());
    fs::write(root.path().join("dataset.toml"), "simulated = true\n").unwrap();
    assert!(open(root.path())[0].is_simulated());
}

/// The mark is found in every layout with such a file, without opening the recording: empty files are enough.
#[test]
fn the_mark_is_read_from_the_file_of_each_layout() {
    const DRIVE: &str = "2026_01_01/2026_01_01_drive_0001_sync";
    let within = |name: &str| format!("{DRIVE}/{name}");
    let (image, poses) = (within("image_02/data/0000000000.png"), within("poses.txt"));
    let (masks, own) = (within("moving_02/0000000000.png"), within("dataset.toml"));
    let [image, poses, masks, own] = [&image, &poses, &masks, &own].map(String::as_str);
    let date = "2026_01_01/dataset.toml";
    let kitti = DatasetKind::KittiRaw;
    // The files, the path given, and the configuration file; the last layout counts as simulated without a mark.
    let layouts: [(DatasetKind, &[&str], &str, &str); 10] = [
        (kitti, &[image], ".", own),
        (kitti, &[image, poses], ".", own),
        (kitti, &[image], DRIVE, date),
        (DatasetKind::Bag, &["a.bag"], "a.bag", "a.toml"),
        (
            DatasetKind::Comma2k19,
            &["global_pose/frame_times"],
            ".",
            "dataset.toml",
        ),
        (
            DatasetKind::RgbD,
            &["room/frame-000000.color.png"],
            ".",
            "room/dataset.toml",
        ),
        (DatasetKind::Folder, &["images/0.png"], ".", "dataset.toml"),
        (DatasetKind::Video, &["a.mp4"], ".", "dataset.toml"),
        (DatasetKind::Video, &["a.mp4"], "a.mp4", "dataset.toml"),
        (kitti, &[image, poses, masks], ".", own),
    ];
    let last = layouts.len() - 1;
    for (number, (kind, files, path, config)) in layouts.into_iter().enumerate() {
        let root = tempfile::tempdir().unwrap();
        for file in files {
            let file = root.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "").unwrap();
        }
        let (path, config) = (root.path().join(path), root.path().join(config));
        assert_eq!(Dataset::kind_at(&path).unwrap(), kind);
        for (text, expected) in [
            ("", number == last),
            ("simulated = false\n", false),
            ("simulated = true\n", true),
        ] {
            fs::write(&config, text).unwrap();
            let found = Dataset::all_simulated_at(&path);
            assert_eq!(found, expected, "{kind:?} by {}: {text}", config.display());
        }
    }
}
