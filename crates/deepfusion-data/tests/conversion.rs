//! A conversion that does not come to its end, and the one after it.

use crate::common::{DRIVE, TinyDrive};
use deepfusion_data::{Dataset, Error, OpenOptions, convert_to_kitti};
use deepfusion_fs::PartialFolder;
use std::fs;
use std::path::Path;

/// More frames than are read and written together.
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
    let written = convert_to_kitti(&[dataset], out, &mut |_, _| {}).unwrap();
    assert_eq!(names(out).len(), 1, "{:?}", names(out));
    let again = Dataset::open(out, &OpenOptions::default()).unwrap();
    assert_eq!(again[0].frames().len(), 12);
    assert!(written.paths[0].starts_with(out) && written.paths[0].is_dir());
}

#[test]
fn one_that_fails_in_the_middle_leaves_nothing() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let dataset = drive(root);
    let image = root.join(DRIVE).join("image_02/data/0000000010.png");
    let whole = fs::read(&image).unwrap();
    fs::write(&image, "broken").unwrap();
    let (new, empty) = (root.join("new"), root.join("empty"));
    fs::create_dir(&empty).unwrap();
    for out in [&new, &empty] {
        let mut done = Vec::new();
        let failed = convert_to_kitti(std::slice::from_ref(&dataset), out, &mut |frames, _| {
            done.push(frames);
        });
        let said = failed.unwrap_err().to_string();
        assert!(said.contains("0000000010.png"), "{said}");
        assert_eq!(done, [8], "it failed after its first frames");
    }
    assert!(!new.exists() && names(&empty).is_empty());
    fs::write(&image, whole).unwrap();
    convert(dataset, &new);
}

#[test]
fn what_a_killed_one_left_is_removed_and_what_another_writes_is_not() {
    let root = tempfile::tempdir().unwrap();
    let dataset = drive(&root.path().join("drive"));
    let out = root.path().join("kitti");
    // Of another date: whatever is half a folder goes.
    let left = out.join(".2011_09_26.17-00ab.partial");
    fs::create_dir_all(left.join("2011_09_26_drive_0001_sync")).unwrap();
    fs::write(out.join(".2011_09_26.17-00ab.partial.lock"), "").unwrap();
    let another = PartialFolder::beside(&out.join("2030_01_02")).unwrap();
    let refused = convert_to_kitti(std::slice::from_ref(&dataset), &out, &mut |_, _| {});
    assert!(matches!(refused, Err(Error::Exists { path }) if path == out));
    assert!(another.path().exists() && !left.exists());
    drop(another);
    convert(dataset, &out);
}
