//! Names of frames in array files and as pictures.

use crate::Dataset;
use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::PathBuf;

/// The names of the selected frames of `datasets` in array files, one list per data set: `0000000005`, or
/// `<drive>/0000000005` if there are several drives, with the camera's folder in between if there are both
/// cameras.
///
/// If several drives have the same name, the second and later ones get a number, in the order of their paths:
/// `<drive>-2/0000000005`. A drive that is given twice has the same names twice.
#[must_use]
pub fn ground_truth_names(datasets: &[Dataset]) -> Vec<Vec<String>> {
    let drives = drive_names(datasets);
    let cameras: HashSet<_> = datasets.iter().map(Dataset::camera).collect();
    let names = datasets.iter().map(|dataset| {
        let mut before = String::new();
        if drives.len() > 1 {
            before += &format!("{}/", drives[&Drive::of(dataset)]);
        }
        if cameras.len() > 1 {
            before += &format!("image_0{}/", dataset.camera().number());
        }
        let name = |frame: &usize| format!("{before}{:010}", dataset.frames()[*frame].number);
        dataset.selected().iter().map(name).collect::<Vec<_>>()
    });
    names.collect()
}

/// Identifies a drive. Its two cameras belong to the same drive.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Drive<'a> {
    /// Its folder, or the file that contains its images.
    path: PathBuf,
    split_name: &'a str,
}

impl<'a> Drive<'a> {
    fn of(dataset: &'a Dataset) -> Self {
        let path = dataset.place();
        Self {
            path: fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            split_name: dataset.split_name(),
        }
    }
}

/// Unique names of the drives, also on file systems that ignore case.
fn drive_names(datasets: &[Dataset]) -> BTreeMap<Drive<'_>, String> {
    let drives = datasets.iter().map(|d| (Drive::of(d), d.name()));
    let drives: BTreeMap<_, _> = drives.collect();
    let mut taken = HashSet::new();
    let names = drives.into_iter();
    names
        .map(|(drive, name)| (drive, unique(name, &mut taken)))
        .collect()
}

/// This name, with a number appended if its lower-case form is already taken: `a`, `a-2`.
fn unique(name: &str, taken: &mut HashSet<String>) -> String {
    let mut candidate = name.to_owned();
    let mut number = 1;
    while !taken.insert(candidate.to_lowercase()) {
        number += 1;
        candidate = format!("{name}-{number}");
    }
    candidate
}
