//! A frame's small files, as `predict` and `perceive` write them.

use std::path::Path;

use deepfusion_records::{FrameRecord, PredictionRecord, Target};
use serde::Deserialize;
use serde_json::Value;

use super::entry::{Entry, FrameFile};
use super::problem::FrameProblem;
use crate::{ContentProblem, Error, Result};

/// Sidecars and lists of targets are smaller; a larger file is another program's.
const MOST_JSON_BYTES: u64 = 16 << 20;

/// The content of a frame's small files, and the problems with them.
#[derive(Default)]
pub(crate) struct SmallFiles {
    pub sidecar: Option<ReadFile<PredictionRecord>>,
    /// Without the targets that cannot be drawn.
    pub targets: Option<ReadFile<FrameRecord>>,
    pub problems: Vec<FrameProblem>,
    /// Whether a file is incomplete, since the frame is still being written.
    pub unfinished: bool,
}

/// A file's JSON, for the page, and its typed content.
pub(crate) struct ReadFile<T> {
    pub json: Value,
    pub record: T,
}

impl SmallFiles {
    /// Reads those that exist.
    pub(crate) fn read(folder: &Path, entry: &Entry) -> Self {
        let mut files = Self::default();
        files.sidecar = files.json(folder, entry.sidecar.as_ref()).map(|json| {
            let record = files.record(entry.sidecar.as_ref(), &json);
            ReadFile { json, record }
        });
        files.targets = files.json(folder, entry.targets.as_ref()).map(|mut json| {
            files.without_undrawable(&mut json);
            let record = files.record(entry.targets.as_ref(), &json);
            ReadFile { json, record }
        });
        files
    }

    /// The file of a frame's depth.
    pub(crate) fn depth<'a>(&self, entry: &'a Entry) -> Option<&'a FrameFile> {
        entry.depths().find(|file| self.belongs_to_sidecar(file))
    }

    /// The file of the standard deviation of a frame's depth.
    pub(crate) fn sigma<'a>(&self, entry: &'a Entry) -> Option<&'a FrameFile> {
        entry
            .sigma
            .as_ref()
            .filter(|file| self.belongs_to_sidecar(file))
    }

    /// Whether an output belongs to the sidecar, if there is one. An output that the sidecar does not name is older, perhaps of another camera.
    /// Sidecars of other programs name no outputs; then all belong.
    fn belongs_to_sidecar(&self, file: &FrameFile) -> bool {
        let sidecar = self.sidecar.as_ref();
        let named = sidecar.and_then(|s| s.json.get("files")?.as_array());
        named.is_none_or(|named| {
            let is_it = |name: &Value| name.as_str() == Some(file.file.as_str());
            named.iter().any(is_it)
        })
    }

    fn json(&mut self, folder: &Path, file: Option<&FrameFile>) -> Option<Value> {
        let outcome = read_json(&folder.join(&file?.file));
        outcome
            .map_err(|e| {
                self.problems.push(FrameProblem::Unreadable(e.to_string()));
                self.unfinished = true;
            })
            .ok()
    }

    /// A file's typed content; the default if another program wrote it.
    fn record<'de, T: Deserialize<'de> + Default>(
        &mut self,
        file: Option<&FrameFile>,
        json: &'de Value,
    ) -> T {
        T::deserialize(json).unwrap_or_else(|e| {
            let file = file.map_or_else(String::new, |f| f.file.clone());
            let why = e.to_string();
            self.problems.push(FrameProblem::Foreign { file, why });
            T::default()
        })
    }

    /// Removes targets without position or size, which cannot be drawn.
    fn without_undrawable(&mut self, frame: &mut Value) {
        let Some(list) = frame.get_mut("targets").and_then(Value::as_array_mut) else {
            self.problems.push(FrameProblem::NoTargets);
            return;
        };
        let targets = list.len();
        list.retain(|target| {
            Target::deserialize(target).is_ok_and(|t| t.size_m.iter().all(|side| *side > 0.0))
        });
        let undrawable = targets - list.len();
        if undrawable > 0 {
            self.problems.push(FrameProblem::Undrawable {
                undrawable,
                targets,
            });
        }
    }
}

/// A small JSON file.
fn read_json(path: &Path) -> Result<Value> {
    let meta = std::fs::metadata(path).map_err(|e| Error::file(path, e))?;
    if meta.len() > MOST_JSON_BYTES {
        let bytes = meta.len();
        return Err(Error::content(path, ContentProblem::TooLong { bytes }));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    serde_json::from_slice(&bytes).map_err(|e| Error::content(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_programs_file_is_ignored_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, r#"{"image": "x.png", "size": "large"}"#).unwrap();
        let meta = std::fs::metadata(&path).unwrap();
        let mut entry = Entry::new("a");
        entry.sidecar = Some(FrameFile::new("a.json".into(), &meta));
        let files = SmallFiles::read(folder.path(), &entry);
        assert!(files.sidecar.unwrap().record.size.is_none() && !files.unfinished);
        let named = |problem: &FrameProblem| matches!(problem, FrameProblem::Foreign { file, .. } if file == "a.json");
        assert!(named(&files.problems[0]), "{:?}", files.problems);
    }
}
