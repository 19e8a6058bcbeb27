//! One run of a table: done, or still to train and evaluate.

use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, Error as DataError, GtKind, OpenOptions};
use deepfusion_eval::{GroundTruth, Protocol};
use deepfusion_model::{CheckpointKind, RunFolder, TrainConfig};
use deepfusion_runtime::DepthEstimator;
use deepfusion_train::{Device, Trainer};

use super::{Plan, Row, RunResult, in_folder};
use crate::evaluation::{Truth, baseline_from_datasets, default_crop, evaluate_datasets, predict};
use crate::samples::{SampleWarning, open_samples};
use crate::{Error, Result};

const RESULT: &str = "result.json";

/// The run of a row with a seed.
pub enum Run {
    /// It is done.
    Done(Box<RunResult>),
    /// It is still to be made or continued.
    Open(Box<OpenRun>),
}

/// A run that is not done yet.
pub struct OpenRun {
    folder: PathBuf,
    row: Row,
    config: TrainConfig,
}

impl Plan {
    /// The run of a row with a seed in the table's folder; `config` is the row's configuration.
    ///
    /// # Errors
    /// [`Error::NoResult`] for a result that cannot be read.
    pub fn run(&self, out: &Path, row: Row, config: &TrainConfig, seed: u64) -> Result<Run> {
        let folder = out.join("rows").join(row.name());
        let folder = folder.join(format!("seed-{seed}"));
        let path = folder.join(RESULT);
        if !path.exists() {
            let config = TrainConfig {
                seed,
                steps: Some(self.budget),
                ..config.clone()
            };
            return Ok(Run::Open(Box::new(OpenRun {
                folder,
                row,
                config,
            })));
        }
        let text = std::fs::read_to_string(&path).map_err(|e| DataError::file(&path, e))?;
        match serde_json::from_str(&text) {
            Ok(result) => Ok(Run::Done(Box::new(result))),
            Err(source) => Err(Error::NoResult { path, source }),
        }
    }
}

impl OpenRun {
    /// The run's own folder.
    #[must_use]
    pub fn run_folder(&self) -> PathBuf {
        self.folder.join("run")
    }

    /// Its trainer, starting at the last checkpoint or from the beginning.
    ///
    /// # Errors
    /// As [`open_samples`]; errors of the trainer.
    pub fn trainer(
        &self,
        device: &Device,
        opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
        warn: &mut dyn FnMut(SampleWarning),
    ) -> Result<Trainer> {
        let sets = open_samples(&self.config, opened, warn)?;
        let run = self.run_folder();
        if let Ok((folder, _)) = RunFolder::open(&run) {
            if folder.checkpoint_path(CheckpointKind::Last).exists() {
                let stored = folder.read_config()?;
                return Ok(Trainer::resume(stored, folder, sets, device)?);
            }
            // The run ended before its first checkpoint: there is nothing to lose.
            std::fs::remove_dir_all(&run).map_err(|e| DataError::file(&run, e))?;
        }
        let folder = RunFolder::create(&run)?;
        Ok(Trainer::create(
            self.config.clone(),
            folder,
            sets,
            device,
            Ok,
        )?)
    }

    /// Adds seconds of training to those from before an interruption, which are saved beside the run.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add_seconds(&self, seconds: f64) -> Result<()> {
        let text = format!("{}\n", self.seconds() + seconds);
        in_folder(&self.seconds_path(), &text)
    }

    fn seconds(&self) -> f64 {
        let kept = std::fs::read_to_string(self.seconds_path()).ok();
        kept.and_then(|t| t.trim().parse().ok()).unwrap_or(0.0)
    }

    fn seconds_path(&self) -> PathBuf {
        self.folder.join("seconds")
    }

    /// Evaluates the run's last checkpoint, run by `estimator`, as `eval` does, and saves the result. The last checkpoint is used so that
    /// equal budgets are compared, not choices of a checkpoint.
    ///
    /// # Errors
    /// Recordings that cannot be evaluated on; files that cannot be written.
    pub fn measure(
        self,
        plan: &Plan,
        estimator: &mut DepthEstimator,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<RunResult> {
        let (train_sets, eval_sets) = plan.open_eval_data()?;
        let protocol = Protocol {
            crop: default_crop(&eval_sets),
            gt: GroundTruth::Z,
            ..Protocol::default()
        };
        let evaluated = evaluate_datasets::<Error>(
            &eval_sets,
            &mut Truth::Scans(GtKind::Z),
            &protocol,
            Some(baseline_from_datasets(&train_sets, GtKind::Z)?),
            &mut |dataset, frame| {
                let image = dataset.load_image(frame)?;
                predict(estimator, &image, &dataset.intrinsics(frame), true)
            },
            progress,
        )?;
        let parts = self.config.depth_net.costs(self.config.size);
        let result = RunResult {
            row: self.row,
            seed: self.config.seed,
            train_seconds: self.seconds(),
            parameters: Some(parts.iter().map(|part| part.parameters).sum()),
            report: evaluated.report,
        };
        let text = serde_json::to_string_pretty(&result)?;
        in_folder(&self.folder.join(RESULT), &text)?;
        Ok(result)
    }
}
