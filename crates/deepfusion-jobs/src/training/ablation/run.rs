//! One run of a table: done, or to be trained and measured.

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

/// A run of a row with a seed.
pub enum Run {
    /// It was made.
    Done(Box<RunResult>),
    /// It is to be made, or gone on with.
    Open(Box<OpenRun>),
}

/// A run that is not done yet.
pub struct OpenRun {
    folder: PathBuf,
    row: Row,
    config: TrainConfig,
}

impl Plan {
    /// The run of a row, whose configuration is `config`, with a seed, in the table's folder.
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

    /// What trains it, where its last checkpoint stands or from the beginning.
    ///
    /// # Errors
    /// As [`open_samples`], and the trainer's.
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
            // It ended before its first checkpoint: nothing is lost with it.
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

    /// Adds seconds of training to those of the times before, which are kept beside the run.
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

    /// Measures the run's last checkpoint, which `estimator` runs, as `eval` does, and keeps what it came to: equal budgets are compared, and
    /// not choices of a checkpoint.
    ///
    /// # Errors
    /// Recordings that cannot be measured on, and files that cannot be written.
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
