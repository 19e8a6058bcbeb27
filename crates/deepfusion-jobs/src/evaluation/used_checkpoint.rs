//! The checkpoint that was evaluated.

use std::fmt;
use std::path::PathBuf;

use deepfusion_model::LearnedCamera;
use deepfusion_runtime::{DepthEstimator, ModelSource};
use serde::Serialize;

/// The checkpoint that was evaluated: a run's folder has two, so its path does not say which.
#[derive(Debug, Clone, Serialize)]
pub struct UsedCheckpoint {
    /// `best` or `last` for a run; a packed network's own name.
    pub name: String,
    /// The path, for a run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// The SHA-256, for a packed network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Number of training steps.
    pub step: usize,
    /// The camera that a run learned, with its accuracy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learned_camera: Option<LearnedCamera>,
    /// Whether a run's folder was given, so that the program chose the checkpoint.
    #[serde(skip)]
    pub chosen: bool,
}

impl UsedCheckpoint {
    /// The checkpoint of an estimator's network.
    #[must_use]
    pub fn of(estimator: &DepthEstimator, model: &ModelSource) -> Self {
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
                    // Another checkpoint has learned another camera.
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

impl fmt::Display for UsedCheckpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, step, .. } = self;
        match &self.path {
            Some(path) => write!(f, "checkpoint  {}, step {step}", path.display())?,
            None => write!(f, "network  {name}, step {step}")?,
        }
        match (self.chosen, name.as_str()) {
            (true, "best") => write!(f, " (the lowest held-out loss; last is beside it)"),
            (true, _) => write!(f, " (best does not exist)"),
            (false, _) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_choice_of_a_runs_checkpoint_is_explained() {
        let of_run = |name: &str, chosen| {
            let checkpoint = UsedCheckpoint {
                name: name.into(),
                path: Some(format!("runs/a/{name}.safetensors").into()),
                sha256: None,
                step: 400,
                learned_camera: None,
                chosen,
            };
            checkpoint.to_string()
        };
        assert_eq!(
            of_run("best", true),
            "checkpoint  runs/a/best.safetensors, step 400 (the lowest held-out loss; last is beside it)"
        );
        assert_eq!(
            of_run("last", true),
            "checkpoint  runs/a/last.safetensors, step 400 (best does not exist)"
        );
        assert_eq!(
            of_run("last", false),
            "checkpoint  runs/a/last.safetensors, step 400"
        );
    }

    #[test]
    fn a_packed_network_is_identified_by_its_checksum() {
        let packed = UsedCheckpoint {
            name: "street".into(),
            path: None,
            sha256: Some("ab12".into()),
            step: 9000,
            learned_camera: None,
            chosen: false,
        };
        assert_eq!(packed.to_string(), "network  street, step 9000");
        assert_eq!(
            serde_json::to_value(&packed).unwrap(),
            serde_json::json!({"name": "street", "sha256": "ab12", "step": 9000})
        );
    }
}
