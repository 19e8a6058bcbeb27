//! Metrics of a checkpoint, from the evaluations saved beside its run.

use std::path::{Path, PathBuf};

use deepfusion_eval::compare::SavedEvaluation;
use deepfusion_weights::Figure;

/// The evaluations of the checkpoint with this SHA-256, in the order of their files' names. Files that cannot be read or belong to another
/// checkpoint are skipped.
#[must_use]
pub(crate) fn figures(run: &Path, sha256: &str) -> Vec<Figure> {
    let Ok(entries) = std::fs::read_dir(run.join("eval")) else {
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let read = |path: &PathBuf| -> Option<SavedEvaluation> {
        serde_json::from_slice(&std::fs::read(path).ok()?).ok()
    };
    let saved = files.iter().filter_map(read);
    saved
        .filter(|saved| saved.model.sha256 == sha256)
        .map(|saved| Figure {
            data: names(&saved.measured.data).join(", "),
            images: saved.report.n,
            held_out: saved.measured.held_out,
            abs_rel: saved.report.unscaled.abs_rel,
            abs_rel_scaled: saved.report.median_scaled.abs_rel,
            scale: saved.report.scale.median,
            a1: saved.report.unscaled.a1,
        })
        .collect()
}

/// The last part of each path, each only once: the rest is specific to one machine.
#[must_use]
pub(crate) fn names<'a>(paths: impl IntoIterator<Item = &'a PathBuf>) -> Vec<String> {
    let mut names = Vec::new();
    for path in paths {
        let name = path.file_name().unwrap_or(path.as_os_str());
        let name = name.to_string_lossy().into_owned();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}
