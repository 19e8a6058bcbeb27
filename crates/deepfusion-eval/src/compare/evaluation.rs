use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::{PostProcess, Report};
use deepfusion_hint::count_of;
use serde_json::Value;

use super::saved::{MeasuredOn, ModelFile, SavedEvaluation, sha256_of_file};
use super::{Error, EvaluationProblem, Result, SAVED_VERSION};

/// An evaluation to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// The name of its rows.
    pub name: String,
    /// The result.
    pub report: Report,
    /// Path of the file it was read from.
    pub path: PathBuf,
    /// What the file records beyond the result.
    pub origin: Origin,
}

/// What is known about an evaluation's origin.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// Nothing: the file contains a plain [`Report`](crate::Report).
    Plain,
    /// A file from a run's folder.
    Saved {
        /// The data that were measured on.
        measured: Box<MeasuredOn>,
        /// The weights that were measured.
        model: ModelFile,
        /// Whether the run's checkpoint has changed since.
        outdated: bool,
    },
}

impl Evaluation {
    /// Reads the paths given: run folders (all their evaluations), saved evaluations, and files with a plain [`Report`](crate::Report).
    /// Rows with the same name get their path and checkpoint added.
    ///
    /// # Errors
    /// [`Error::NotEvaluated`], [`Error::NotAnEvaluation`], [`Error::Version`], [`Error::File`].
    pub fn collect(paths: &[PathBuf]) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        let mut digests = HashMap::new();
        for path in paths {
            if path.is_dir() {
                let files = SavedEvaluation::files(path);
                if files.is_empty() {
                    return Err(Error::NotEvaluated { path: path.clone() });
                }
                for file in files {
                    all.push(Self::read(&file, Some(path), &mut digests)?);
                }
            } else {
                all.push(Self::read(path, None, &mut digests)?);
            }
        }
        distinguish(&mut all);
        Ok(all)
    }

    fn read(
        path: &Path,
        run: Option<&Path>,
        digests: &mut HashMap<PathBuf, Option<String>>,
    ) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
        let not = |reason: EvaluationProblem| Error::NotAnEvaluation {
            path: path.to_owned(),
            reason,
        };
        let value: Value = serde_json::from_str(&text).map_err(|e| not(e.into()))?;
        let Some(version) = value.get("format_version") else {
            let report = serde_json::from_value(value).map_err(|e| not(e.into()))?;
            let stem = path.file_stem().unwrap_or(path.as_os_str());
            return Ok(Self {
                name: stem.to_string_lossy().into_owned(),
                report,
                path: path.to_owned(),
                origin: Origin::Plain,
            });
        };
        let version = version.as_u64().and_then(|v| u32::try_from(v).ok());
        match version {
            Some(found) if found > SAVED_VERSION => {
                let path = path.to_owned();
                return Err(Error::Version { path, found });
            }
            Some(_) => {}
            None => return Err(not(EvaluationProblem::VersionNumber)),
        }
        let saved: SavedEvaluation = serde_json::from_value(value).map_err(|e| not(e.into()))?;
        // Saved evaluations are in RUN/eval.
        let run = run.or_else(|| path.parent().and_then(Path::parent));
        let now = run.and_then(|run| {
            let checkpoint = run.join(&saved.model.checkpoint);
            let digest = digests.entry(checkpoint);
            digest
                .or_insert_with_key(|file| sha256_of_file(file).ok())
                .clone()
        });
        let folder = run.map(|run| run.canonicalize().unwrap_or_else(|_| run.to_owned()));
        let name = folder.as_deref().and_then(Path::file_name);
        Ok(Self {
            name: name
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned(),
            report: saved.report,
            path: path.to_owned(),
            origin: Origin::Saved {
                outdated: now.is_some_and(|now| now != saved.model.sha256),
                measured: Box::new(saved.measured),
                model: saved.model,
            },
        })
    }

    fn checkpoint(&self) -> Option<&str> {
        match &self.origin {
            Origin::Plain => None,
            Origin::Saved { model, .. } => Some(model.checkpoint.trim_end_matches(".safetensors")),
        }
    }

    fn engine(&self) -> Option<&str> {
        match &self.origin {
            Origin::Plain => None,
            Origin::Saved { measured, .. } => Some(&measured.engine),
        }
    }

    /// The test-time augmentation; `None` if each image was predicted once.
    pub(crate) fn post_process(&self) -> Option<PostProcess> {
        match &self.origin {
            Origin::Plain => None,
            Origin::Saved { measured, .. } => measured.post_process,
        }
    }

    /// What two rows must have in common to be in one table: the protocol, and exactly the same ground truth. Files that do not record the
    /// ground truth never share a table with files that do.
    pub(crate) fn ground(&self) -> String {
        let report = &self.report;
        let p = &report.protocol;
        let truth = match &report.truth_sha256 {
            Some(digest) => format!("truth {digest}"),
            None => format!("unknown truth, {}", count_of(report.n, "image")),
        };
        format!("{:?} {} {} {:?} {truth}", p.crop, p.cap_m, p.min_m, p.gt)
    }
}

/// What a row's name adds if its predictions were post-processed. In the field's tables, "post-processed" alone means averaging with the
/// mirrored image.
pub(crate) fn in_words(how: PostProcess) -> String {
    match how {
        PostProcess::Flip => "post-processed".into(),
        other => format!("post-processed: {}", other.name()),
    }
}

/// Adds to rows of the same name and table what distinguishes them: the checkpoint, then the engine, then the path.
fn distinguish(all: &mut [Evaluation]) {
    type Distinction = fn(&Evaluation) -> Option<String>;
    let distinctions: [Distinction; 4] = [
        |e| e.post_process().map(in_words),
        |e| e.checkpoint().map(str::to_owned),
        |e| e.engine().map(str::to_owned),
        |e| Some(e.path.display().to_string()),
    ];
    for distinction in distinctions {
        let mut groups = HashMap::<(String, String), Vec<usize>>::new();
        for (i, evaluation) in all.iter().enumerate() {
            let key = (evaluation.name.clone(), evaluation.ground());
            groups.entry(key).or_default().push(i);
        }
        for members in groups.into_values().filter(|m| m.len() > 1) {
            let words: Vec<_> = members.iter().map(|i| distinction(&all[*i])).collect();
            if words.iter().all(|w| *w == words[0]) {
                continue;
            }
            for (i, word) in members.into_iter().zip(words) {
                if let Some(word) = word {
                    all[i].name = format!("{} ({word})", all[i].name);
                }
            }
        }
    }
}
