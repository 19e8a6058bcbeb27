//! Tables of ablations, as in the paper's Table 3: runs of equal budget that differ in one part each, evaluated in the same way.
//!
//! The request for a new table ([`PlanRequest`]) gives a [`Plan`]. It is saved beside the table, so that the table can be continued.
//! [`Plan::run`] returns, for each row and seed, either the result or the [`OpenRun`] to train and evaluate.

mod request;
mod rows;
mod run;
mod table;

use std::path::{Path, PathBuf};

use deepfusion_data::{Cameras, Dataset, Error as DataError, OpenOptions};
use deepfusion_hint::count_of;
use deepfusion_model::{Error as ModelError, TrainConfig};
use serde::{Deserialize, Deserializer, Serialize};

pub use self::request::{PlanRequest, TableDecides};
pub use self::rows::Row;
pub use self::run::{OpenRun, Run};
pub use self::table::{RunResult, Spread, TableRow, table, text};

use crate::Result;
use crate::files::write;
use crate::recordings::{open_recordings, training_recordings};

/// The plan of a table.
#[derive(Debug, Serialize, Deserialize)]
pub struct Plan {
    /// Optimiser steps of every run.
    pub budget: usize,
    /// Number of seeds, counted from 0.
    pub seeds: u64,
    /// The rows.
    pub rows: Vec<Row>,
    /// Recordings to evaluate on; empty: the training recordings.
    pub eval_data: Vec<PathBuf>,
    /// The settings that all rows share.
    #[serde(deserialize_with = "settings")]
    pub config: TrainConfig,
}

/// Reads a configuration; one that an earlier run wrote may also contain that run's findings.
fn settings<'de, D: Deserializer<'de>>(from: D) -> Result<TrainConfig, D::Error> {
    let read = TrainConfig::from_run_table(toml::Table::deserialize(from)?);
    Ok(read.map_err(serde::de::Error::custom)?.0)
}

const PLAN: &str = "ablate.toml";

impl Plan {
    /// Reads the plan of a table that was begun.
    ///
    /// # Errors
    /// A file that is missing or invalid.
    pub fn read(out: &Path) -> Result<Self> {
        let path = out.join(PLAN);
        let text = std::fs::read_to_string(&path).map_err(|e| DataError::file(&path, e))?;
        Ok(toml::from_str(&text).map_err(|e| ModelError::ConfigFile {
            path,
            reason: e.into(),
        })?)
    }

    /// Changes a plan to continue its table: more runs of every row, and new paths of the training recordings (empty: unchanged).
    pub fn continue_with(&mut self, seeds: u64, data: &[PathBuf]) {
        self.seeds = self.seeds.max(seeds);
        if !data.is_empty() {
            self.config.data.paths = data.to_vec();
            self.config.make_absolute();
        }
    }

    /// Saves the plan beside the table.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Path) -> Result<()> {
        in_folder(&out.join(PLAN), &toml::to_string_pretty(self)?)
    }

    /// The configuration of each row: all are checked before the first trains for hours.
    ///
    /// # Errors
    /// [`ModelError::Config`] if the shared settings contradict a row's.
    pub fn row_configs(&self) -> Result<Vec<TrainConfig>> {
        let configs = self.rows.iter().map(|row| row.config(&self.config));
        Ok(configs.collect::<Result<_, _>>()?)
    }

    /// The training recordings, for the mean-depth baseline, and the recordings to evaluate on.
    ///
    /// # Errors
    /// As [`open_recordings`].
    pub fn open_eval_data(&self) -> Result<(Vec<Dataset>, Vec<Dataset>)> {
        let trained_on = || -> Result<Vec<Dataset>> {
            let recordings = training_recordings(&self.config)?;
            Ok(recordings.into_iter().map(|(_, dataset)| dataset).collect())
        };
        let measured_on = match self.eval_data.as_slice() {
            [] => trained_on()?,
            paths => {
                let options = OpenOptions {
                    camera: Cameras::default(),
                    ..OpenOptions::default()
                };
                open_recordings(paths, &options)?
            }
        };
        Ok((trained_on()?, measured_on))
    }

    /// Writes the table so far in four forms: for a terminal, a spreadsheet, a README and a paper.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_tables(&self, out: &Path, results: &[RunResult]) -> Result<()> {
        let table = table::table(&self.rows, results);
        let mut text = table::text(&table);
        let place = if self.eval_data.is_empty() {
            "evaluated on the training recordings"
        } else {
            "evaluated on other recordings than the training recordings"
        };
        text.push_str(&format!(
            "\n{} per run, {place}; mean ± standard deviation over seeds; \
             the seven metrics unscaled, abs_rel_scaled after median scaling; parameters of the depth network\n",
            count_of(self.budget, "step")
        ));
        if let Some(mean_depth_baseline) = results
            .iter()
            .find_map(|r| r.report.mean_depth_baseline.as_ref())
        {
            text.push_str(&format!(
                "mean-depth baseline: abs_rel {:.3} unscaled, {:.3} median-scaled\n",
                mean_depth_baseline.unscaled.abs_rel, mean_depth_baseline.median_scaled.abs_rel
            ));
        }
        in_folder(&out.join("table.txt"), &text)?;
        in_folder(&out.join("table.csv"), &table::csv(&table))?;
        in_folder(&out.join("table.md"), &table::markdown(&table))?;
        in_folder(&out.join("table.tex"), &table::latex(&table))
    }
}

/// Writes a text file atomically, in a folder that is created.
fn in_folder(path: &Path, text: &str) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|e| DataError::file(parent, e))?;
    }
    Ok(write(path, text)?)
}
