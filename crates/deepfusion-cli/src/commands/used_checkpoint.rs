use std::path::PathBuf;

use deepfusion_model::LearnedCamera;
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use serde::Serialize;

/// The checkpoint that was measured: a run's folder alone does not say which of its two.
#[derive(Serialize)]
pub(super) struct UsedCheckpoint {
    /// `best` or `last` of a run; a packed network's own name.
    name: String,
    /// Of a run.
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<PathBuf>,
    /// Of a packed network.
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    step: usize,
    /// The camera that a run learned, and how well.
    #[serde(skip_serializing_if = "Option::is_none")]
    learned_camera: Option<LearnedCamera>,
    /// Whether a run's folder was given, and the choice is the program's.
    #[serde(skip)]
    chosen: bool,
}

impl UsedCheckpoint {
    /// That of an estimator's network.
    pub(super) fn of(estimator: &DepthEstimator, model: &ModelSource) -> Self {
        let step = estimator.step;
        match model {
            ModelSource::Run {
                given,
                folder,
                kind,
            } => Self {
                name: kind.name().into(),
                path: Some(folder.checkpoint_path(*kind)),
                sha256: None,
                step,
                learned_camera: folder
                    .read_findings()
                    .ok()
                    .and_then(|found| found.learned_camera)
                    // Another checkpoint has another camera.
                    .filter(|learned| learned.step == step),
                chosen: given == folder.path(),
            },
            ModelSource::Packed { network, .. } => Self {
                name: network.card.name.clone(),
                path: None,
                sha256: Some(network.card.sha256.clone()),
                step,
                learned_camera: None,
                chosen: false,
            },
        }
    }
}

impl std::fmt::Display for UsedCheckpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, step, .. } = self;
        match &self.path {
            Some(path) => write!(f, "checkpoint  {}, step {step}", path.display())?,
            None => write!(f, "network  {name}, step {step}")?,
        }
        match (self.chosen, name.as_str()) {
            (true, "best") => write!(f, " (the lowest held-out loss; last is beside it)"),
            (true, _) => write!(f, " (there is no best)"),
            (false, _) => Ok(()),
        }
    }
}
