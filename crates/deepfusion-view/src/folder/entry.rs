//! The files of one frame.

use std::collections::hash_map::DefaultHasher;
use std::fs::Metadata;
use std::hash::{Hash, Hasher};

use super::summary::Summary;

/// The kind of a frame's file, by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum FileKind {
    /// `NAME.json`.
    Sidecar,
    /// `NAME_depth.npy`.
    DepthArray,
    /// `NAME_depth.png`.
    DepthPng,
    /// `NAME_sigma.npy`.
    Sigma,
    /// `NAME_image.jpg` or `.png`.
    Image,
    /// `NAME_targets.json`.
    Targets,
}

/// File name endings and their kinds. The plain `.json` is last, since others end with it, too.
const ENDINGS: [(&str, FileKind); 8] = [
    ("_depth.png", FileKind::DepthPng),
    ("_depth.npy", FileKind::DepthArray),
    ("_sigma.npy", FileKind::Sigma),
    ("_image.jpg", FileKind::Image),
    ("_image.jpeg", FileKind::Image),
    ("_image.png", FileKind::Image),
    ("_targets.json", FileKind::Targets),
    (".json", FileKind::Sidecar),
];

/// The frame's name and the kind of a file, from its name.
pub(super) fn frame_and_kind(file: &str) -> Option<(&str, FileKind)> {
    // Temporary files begin with a dot; a shard's manifest is no sidecar.
    if file.starts_with('.') || file.ends_with(".manifest.json") {
        return None;
    }
    let (name, kind) = ENDINGS
        .iter()
        .find_map(|(ending, kind)| Some((file.strip_suffix(ending)?, *kind)))?;
    (!name.is_empty()).then_some((name, kind))
}

/// A file of a frame: its name, and a mark that changes when the file does.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct FrameFile {
    /// Its name in the folder.
    pub file: String,
    /// Length in bytes and modification time in nanoseconds.
    mark: (u64, u128),
}

impl FrameFile {
    pub(crate) fn new(file: String, meta: &Metadata) -> Self {
        let since = meta
            .modified()
            .ok()
            .map(|t| t.duration_since(std::time::UNIX_EPOCH));
        let changed = since.and_then(Result::ok).map_or(0, |d| d.as_nanos());
        Self {
            file,
            mark: (meta.len(), changed),
        }
    }
}

/// A frame: its existing files, and a summary of the small ones.
#[derive(Debug, Clone, Default)]
pub(crate) struct Entry {
    /// The prefix of its files' names.
    pub name: String,
    pub sidecar: Option<FrameFile>,
    pub depth_array: Option<FrameFile>,
    pub depth_png: Option<FrameFile>,
    pub sigma: Option<FrameFile>,
    pub image: Option<FrameFile>,
    pub targets: Option<FrameFile>,
    /// `None` until its small files were read.
    pub summary: Option<Summary>,
}

impl Entry {
    pub(crate) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }

    /// The files that may be its depth, the most exact first: an array's metres are not rounded.
    pub(crate) fn depths(&self) -> impl Iterator<Item = &FrameFile> {
        [&self.depth_array, &self.depth_png].into_iter().flatten()
    }

    /// Whether any file may be its depth.
    pub(crate) fn may_have_depth(&self) -> bool {
        self.depths().next().is_some()
    }

    /// Adds a file. Of two files of a kind, the first by name is kept.
    pub(crate) fn add(&mut self, kind: FileKind, file: FrameFile) {
        let place = match kind {
            FileKind::Sidecar => &mut self.sidecar,
            FileKind::DepthArray => &mut self.depth_array,
            FileKind::DepthPng => &mut self.depth_png,
            FileKind::Sigma => &mut self.sigma,
            FileKind::Image => &mut self.image,
            FileKind::Targets => &mut self.targets,
        };
        if place.as_ref().is_none_or(|there| file.file < there.file) {
            *place = Some(file);
        }
    }

    /// A number that changes with any of the files.
    pub(crate) fn revision(&self) -> u64 {
        let mut hash = DefaultHasher::new();
        let files = [
            &self.sidecar,
            &self.depth_array,
            &self.depth_png,
            &self.sigma,
            &self.image,
            &self.targets,
        ];
        files.hash(&mut hash);
        // JavaScript's numbers hold 53 bits exactly.
        hash.finish() >> 12
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_into_frame_and_kind() {
        for (file, expected) in [
            ("0000000005.json", Some(("0000000005", FileKind::Sidecar))),
            (
                "0000000005_targets.json",
                Some(("0000000005", FileKind::Targets)),
            ),
            ("a_b_depth.npy", Some(("a_b", FileKind::DepthArray))),
            ("a_depth.png", Some(("a", FileKind::DepthPng))),
            ("a_sigma.npy", Some(("a", FileKind::Sigma))),
            ("a_image.jpeg", Some(("a", FileKind::Image))),
            ("predict-1-of-1.manifest.json", None),
            (".a.json.12-0.partial", None),
            (".a.json", None),
            ("_depth.png", None),
            (".json", None),
            ("a_color.png", None),
            ("a.ply", None),
        ] {
            assert_eq!(frame_and_kind(file), expected, "{file}");
        }
    }
}
