//! The request for a new table, and the plan that follows from it.

use std::path::PathBuf;

use deepfusion_data::Cameras;
use deepfusion_fs::absolute;
use deepfusion_model::{
    Compute, Error as ModelError, InputSize, Preset, SettingProblem, TrainConfig, ViewMotion,
};

use super::{Plan, Row};
use crate::Result;
use crate::recordings::camera_word;

/// The request for a new table. What is not set comes from the file or the preset.
#[derive(Debug, Clone, Default)]
pub struct PlanRequest {
    /// A configuration file, read over its preset.
    pub file: Option<Box<TrainConfig>>,
    /// A preset, used without a file; by default [`Preset::Light`].
    pub preset: Option<Preset>,
    /// The kind of device, which determines a preset's sizes.
    pub compute: Compute,
    /// Parts that are switched on in all rows.
    pub with: Vec<String>,
    /// Parts that are switched off in all rows.
    pub without: Vec<String>,
    /// The pose used for warping; by default the file's, otherwise PoseNet's.
    pub view_motion: Option<ViewMotion>,
    /// The size of the network's input.
    pub size: Option<InputSize>,
    /// Number of samples in a batch.
    pub batch: Option<usize>,
    /// Keys with values, such as `batch=4`.
    pub assignments: Vec<String>,
    /// Recordings to train on.
    pub data: Vec<PathBuf>,
    /// Their cameras.
    pub camera: Cameras,
    /// Recordings to evaluate on; empty: the training recordings.
    pub eval_data: Vec<PathBuf>,
    /// Names of rows; empty: those of the paper's table.
    pub rows: Vec<String>,
    /// Optimiser steps of every run, at least one.
    pub budget: usize,
    /// Number of runs of every row, at least one.
    pub seeds: u64,
}

impl PlanRequest {
    /// The plan. Its paths are absolute, so that the table can be continued from any folder.
    ///
    /// # Errors
    /// An unknown term or key; [`SettingProblem::DecidedElsewhere`] for a key that [`TableDecides`]; as [`Row::named`].
    pub fn plan(&self) -> Result<Plan> {
        let mut config = match &self.file {
            Some(file) => (**file).clone(),
            None => {
                let preset = self.preset.unwrap_or(Preset::Light);
                let mut config = preset.config_on(self.compute);
                // Warping by the measured motion would also teach the rows without the speed loss; and masks of dynamic pixels are not part
                // of the flow loss.
                config.view_motion = ViewMotion::PoseNet;
                config.loss.moving.enabled = false;
                config
            }
        };
        for term in &self.with {
            config.with(term)?;
        }
        for term in &self.without {
            config.without(term)?;
        }
        config.view_motion = self.view_motion.unwrap_or(config.view_motion);
        config.size = self.size.unwrap_or(config.size);
        config.batch = self.batch.unwrap_or(config.batch);
        for assignment in &self.assignments {
            if let Some(decides) = TableDecides::about(assignment) {
                return Err(ModelError::Setting {
                    assignment: assignment.clone(),
                    reason: SettingProblem::DecidedElsewhere(decides.reason()),
                }
                .into());
            }
            config.set(assignment)?;
        }
        config.data.paths.clone_from(&self.data);
        config.data.camera = camera_word(self.camera).into();
        // Every row starts from scratch.
        (config.init, config.init_sha256) = (None, None);
        config.make_absolute();
        Ok(Plan {
            budget: self.budget.max(1),
            seeds: self.seeds.max(1),
            rows: Row::named(&self.rows)?,
            eval_data: self.eval_data.iter().map(|path| absolute(path)).collect(),
            config,
        })
    }
}

/// Settings of its runs that a table decides, so that no key may set them for all rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TableDecides {
    /// The length of a run.
    Length,
    /// Its seed.
    Seed,
    /// What it starts from.
    Start,
    /// What it learns from.
    Recordings,
    /// Their cameras.
    Cameras,
}

impl TableDecides {
    /// What the table decides about the key of an assignment, such as `seed=3`.
    #[must_use]
    pub fn about(assignment: &str) -> Option<Self> {
        // For a list's element, such as `data.paths[0]`, what it decides about the list.
        let key = assignment.split(['=', '[']).next().unwrap_or_default();
        match key.trim() {
            "steps" | "epochs" | "min_steps" => Some(Self::Length),
            "seed" => Some(Self::Seed),
            "init" | "init_sha256" => Some(Self::Start),
            "data.paths" => Some(Self::Recordings),
            "data.camera" => Some(Self::Cameras),
            _ => None,
        }
    }

    /// Why the setting is decided by the table.
    #[must_use]
    pub fn reason(self) -> &'static str {
        match self {
            Self::Length => "the table's budget determines how long every run is trained",
            Self::Seed => {
                "the table's number of seeds determines the runs of a row and their seeds"
            }
            Self::Start => "every run starts from scratch",
            Self::Recordings => "the table determines the recordings",
            Self::Cameras => "the table determines the cameras",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> PlanRequest {
        PlanRequest {
            data: vec!["street".into()],
            ..PlanRequest::default()
        }
    }

    /// Parts that would teach a row more than its own parts are off by default.
    #[test]
    fn parts_that_would_blur_the_rows_are_off_in_presets_only() {
        let plan = request().plan().unwrap();
        assert_eq!((plan.budget, plan.seeds, plan.rows.len()), (1, 1, 8));
        assert_eq!(plan.config.preset, Preset::Light);
        assert_eq!(plan.config.view_motion, ViewMotion::PoseNet);
        assert!(!plan.config.loss.moving.enabled);
        assert!(plan.config.data.paths[0].is_absolute());
        let file = TrainConfig {
            view_motion: ViewMotion::Distance,
            init: Some("other".into()),
            ..Preset::Paper.config()
        };
        assert!(file.loss.moving.enabled);
        let by_file = PlanRequest {
            file: Some(Box::new(file)),
            ..request()
        };
        let config = by_file.plan().unwrap().config;
        assert_eq!(config.view_motion, ViewMotion::Distance);
        assert!(config.loss.moving.enabled);
        assert_eq!(config.init, None);
        let asked = PlanRequest {
            view_motion: Some(ViewMotion::PoseNet),
            without: vec!["moving".into()],
            ..by_file
        };
        let config = asked.plan().unwrap().config;
        assert_eq!(config.view_motion, ViewMotion::PoseNet);
        assert!(!config.loss.moving.enabled);
    }

    #[test]
    fn settings_decided_by_the_table_are_refused() {
        let with = |assignment: &str| {
            let assignments = vec![assignment.to_owned()];
            let request = PlanRequest {
                assignments,
                ..request()
            };
            request.plan()
        };
        let config = with("loss.smoothness=0.02").unwrap().config;
        assert_eq!(config.loss.smoothness, 0.02);
        for (assignment, decides) in [
            ("min_steps = 3", TableDecides::Length),
            ("seed=3", TableDecides::Seed),
            ("init=\"a\"", TableDecides::Start),
            ("data.paths=[]", TableDecides::Recordings),
            ("data.paths[0]=a", TableDecides::Recordings),
            ("data.camera=\"3\"", TableDecides::Cameras),
        ] {
            assert_eq!(TableDecides::about(assignment), Some(decides));
            let error = with(assignment).unwrap_err().to_string();
            assert!(error.contains(assignment), "{error}");
            assert!(error.contains(decides.reason()), "{error}");
        }
    }
}
