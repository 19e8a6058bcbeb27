//! The mark of a simulated recording: in every layout that has one, and after a conversion.

use crate::common::bag::{CAMERA, TinyBag};
use crate::common::folder;
use deepfusion_data::{Dataset, OpenOptions, convert_to_bag, convert_to_kitti};
use deepfusion_rosbag::Compression;
use std::fs;
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
fn the_mark_goes_from_layout_to_layout() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let bag = bag(root, |_| ());
    for marked in [false, true] {
        if marked {
            mark(&bag);
        }
        let kitti = root.join(format!("kitti-{marked}"));
        convert_to_kitti(&open(&bag), &kitti, &mut |_, _| {}).unwrap();
        let again = root.join(format!("again-{marked}.bag"));
        let drive = open(&kitti).remove(0);
        convert_to_bag(&drive, &again, Compression::None, &mut |_, _| {}).unwrap();
        for path in [&bag, &kitti, &again] {
            let said = (
                open(path)[0].is_simulated(),
                Dataset::all_simulated_at(path),
            );
            assert_eq!(said, (marked, marked), "{}", path.display());
        }
    }
    assert!(!Dataset::all_simulated_at(&root.join("nowhere")));
}

/// Of a date with both, each drive has its own; a file of a drive's does not take the date's mark away.
#[test]
fn drives_of_one_date_are_told_apart() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let bag = bag(root, |_| ());
    let real = open(&bag).remove(0);
    mark(&bag);
    let simulated = open(&bag).remove(0);
    let convert = |name: &str, drives: &[Dataset]| {
        let kitti = root.join(name);
        let paths = convert_to_kitti(drives, &kitti, &mut |_, _| {})
            .unwrap()
            .paths;
        (kitti, paths)
    };
    let marks =
        |path: &Path| -> Vec<bool> { open(path).iter().map(Dataset::is_simulated).collect() };
    let (both, _) = convert("both", &[real, simulated.clone()]);
    assert_eq!(marks(&both), [false, true]);
    assert!(!Dataset::all_simulated_at(&both));
    let (alone, paths) = convert("alone", &[simulated.clone(), simulated]);
    fs::write(paths[0].join("dataset.toml"), "vehicle.speed_scale = 0.9\n").unwrap();
    assert_eq!(marks(&alone), [true, true]);
}

/// What nobody can record tells it of a bag whose file is lost; one of the two may be a better sensor's.
#[test]
fn exact_motion_and_depth_are_a_simulators() {
    for (with_depth, expected) in [(false, false), (true, true)] {
        let root = tempfile::tempdir().unwrap();
        let bag = bag(root.path(), |bag| {
            bag.odometry("/truth/odometry", 5.0);
            if with_depth {
                bag.images("/truth/depth/compressed");
            }
        });
        assert_eq!(open(&bag)[0].is_simulated(), expected);
    }
}

#[test]
fn a_folder_says_it_in_its_file() {
    let root = tempfile::tempdir().unwrap();
    folder::write_drive(root.path(), 4, 5.0, 0.0);
    assert!(!open(root.path())[0].is_simulated());
    fs::write(root.path().join("dataset.toml"), "simulated = true\n").unwrap();
    assert!(open(root.path())[0].is_simulated());
    assert!(Dataset::all_simulated_at(root.path()));
}
