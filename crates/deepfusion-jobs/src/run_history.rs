//! A run's training history, from the files in its folder.

use std::path::Path;

use deepfusion_hint::count_of;
use deepfusion_render::{HtmlReport, LearningLog};
use serde::Deserialize;

use crate::Result;

/// A run's training history, from the files in its folder.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct RunHistory {
    /// Its losses, step by step; `None` without a log.
    pub log: Option<LearningLog>,
    /// Number of images that go through the network in a step, if the configuration says so.
    pub images_a_step: Option<f64>,
    /// The text of its `config.toml`, if it exists.
    pub settings: Option<String>,
}

impl RunHistory {
    /// Reads the history of the run in a folder.
    ///
    /// # Errors
    /// A `log.csv` that another program wrote.
    pub fn read(run: &Path) -> Result<Self> {
        let settings = std::fs::read_to_string(run.join("config.toml")).ok();
        let log = run.join("log.csv");
        Ok(Self {
            log: if log.exists() {
                Some(LearningLog::read(&log)?)
            } else {
                None
            },
            images_a_step: settings.as_deref().and_then(images_a_step),
            settings,
        })
    }

    /// Adds the training curves and the settings to a page, as far as the folder has them.
    #[must_use]
    pub fn add_to(&self, mut page: HtmlReport) -> HtmlReport {
        if let Some(log) = &self.log {
            page = page
                .section("Learning curves")
                .note(&format!(
                    "{}; training curves are means over intervals of steps; held-out curves are on samples never trained on.",
                    count_of(log.steps(), "step")
                ))
                .learning(log, self.images_a_step);
        }
        if let Some(settings) = &self.settings {
            page = page
                .section("Settings")
                .settings("config.toml of the run", settings);
        }
        page
    }
}

/// Number of images that go through the network in a step, from a run's configuration, even if other parts of it are invalid.
fn images_a_step(config: &str) -> Option<f64> {
    #[derive(Deserialize)]
    struct Batch {
        batch: f64,
        #[serde(default = "one")]
        accumulate: f64,
    }
    fn one() -> f64 {
        1.0
    }
    let batch: Batch = toml::from_str(config).ok()?;
    Some(batch.batch * batch.accumulate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_images_of_a_step_are_in_the_configuration() {
        assert_eq!(images_a_step("batch = 4\naccumulate = 3\n"), Some(12.0));
        assert_eq!(images_a_step("batch = 4\n"), Some(4.0));
        assert_eq!(images_a_step("nothing"), None);
    }

    #[test]
    fn a_run_without_a_log_has_its_settings() {
        let run = tempfile::tempdir().unwrap();
        assert_eq!(RunHistory::read(run.path()).unwrap(), RunHistory::default());
        std::fs::write(run.path().join("config.toml"), "batch = 4\n").unwrap();
        let history = RunHistory::read(run.path()).unwrap();
        assert_eq!(history.settings.as_deref(), Some("batch = 4\n"));
        assert_eq!((history.images_a_step, history.log), (Some(4.0), None));
    }
}
