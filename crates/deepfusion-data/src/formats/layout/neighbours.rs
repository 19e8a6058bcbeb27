//! Finds what looks like another recording in a recording's folder, and is not read with it.

use crate::dataset_toml::FolderConfig;
use crate::formats::comma;
use deepfusion_video::is_video;
use std::path::{Path, PathBuf};

/// Extensions of bags.
const BAGS: [&str; 3] = ["bag", "mcap", "db3"];
/// Files and folders by which a folder is recognised as a recording.
const MARKS: [&str; 9] = [
    FolderConfig::NAME,
    "speed.csv",
    "image_02",
    "image_03",
    "sequences",
    "data_2d_raw",
    "v1.0-mini",
    "v1.0-trainval",
    "v1.0-test",
];
/// End of the names of the manifests written by `predict`: videos beside them are outputs.
const OUTPUTS: &str = ".manifest.json";
/// Name of the file of all targets, written by `perceive`.
const TARGETS: &str = "targets.jsonl";
/// Name of the file about the source in a folder of decoded frames, whose name ends in `.frames`.
const ORIGIN: &str = "origin.json";
/// End of the names of videos written by `predict`, also from live sources, whose folder has no manifest.
const OUTPUT_VIDEO: &str = "_video.mp4";

/// What to look for in a recording's folder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NeighbourSearch<'a> {
    /// Paths of files and folders that are read with the recording.
    pub(crate) used: &'a [PathBuf],
    /// Whether a video counts as another recording.
    pub(crate) videos: bool,
    /// Whether a folder may be another recording, instead of a part of this one.
    pub(crate) folders: bool,
}

/// The sorted names of what looks like recordings in a folder. Only names are checked, because the folder may have a hundred
/// thousand images.
pub(crate) fn unread(folder: &Path, wanted: NeighbourSearch) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if is_hidden(&path) || wanted.used.iter().any(|used| used.starts_with(&path)) {
            continue;
        }
        let is_folder = entry
            .file_type()
            .is_ok_and(|kind| kind.is_dir() || kind.is_symlink() && path.is_dir());
        let is_recording = if is_folder {
            wanted.folders && contains_recording(&path)
        } else {
            is_bag(&path) || wanted.videos && is_source_video(&path)
        };
        if is_recording {
            found.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    found.sort();
    found
}

/// Whether a folder has outputs: those of `predict` or `perceive`, or a video's decoded frames.
pub(crate) fn contains_outputs(folder: &Path) -> bool {
    let is_of_frames = folder.extension().is_some_and(|ending| ending == "frames");
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.any(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        name.ends_with(OUTPUTS) || name == TARGETS || is_of_frames && name == ORIGIN
    })
}

fn contains_recording(folder: &Path) -> bool {
    let mut found = comma::is_segment(folder);
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.ends_with(OUTPUTS) {
            return false;
        }
        let is_file_of_one = !is_hidden(&path) && (is_bag(&path) || is_source_video(&path));
        found |= MARKS.contains(&&*name) || is_file_of_one;
    }
    found
}

/// Whether a file's name is that of a video, but not of an output.
fn is_source_video(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    is_video(path) && !name.ends_with(OUTPUT_VIDEO.as_bytes())
}

fn is_bag(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    BAGS.contains(&ending.to_ascii_lowercase().as_str())
}

fn is_hidden(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name.as_encoded_bytes().starts_with(b".")
}
