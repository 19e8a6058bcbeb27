//! An evaluation as it is saved beside a run.

use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_eval::Holes;
use deepfusion_eval::compare::{FrameScore, MeasuredOn, ModelFile, SAVED_VERSION, SavedEvaluation};
use deepfusion_fs::absolute;
use deepfusion_runtime::{DepthEstimator, ModelSource, Precision};

use super::{Evaluated, MeasurementRequest};
use crate::held_out::learned_from_none;
use crate::recordings::camera_word;
use crate::{ModelFacts, Result, dates, name_of};

/// The request for a network's evaluation.
#[derive(Debug, Clone)]
pub struct EvaluationRequest<'a> {
    /// The recordings.
    pub data: &'a [PathBuf],
    /// The split file, if any.
    pub split: Option<&'a Path>,
    /// What depth is compared with, and how.
    pub measurement: MeasurementRequest<'a>,
    /// The options that the recordings were opened with.
    pub options: OpenOptions,
    /// The precision in which the network is computed.
    pub precision: Precision,
    /// The training data set whose metric scale is used, if there were several.
    pub set: Option<&'a str>,
    /// The program that evaluates, with its version.
    pub program: String,
    /// The command as typed.
    pub command: String,
}

impl EvaluationRequest<'_> {
    /// The results for a network, as they are saved beside its run.
    ///
    /// # Errors
    /// A checkpoint, or a run's findings, that cannot be read.
    pub fn saved(
        &self,
        model: &ModelSource,
        estimator: &DepthEstimator,
        datasets: &[Dataset],
        evaluated: &Evaluated,
    ) -> Result<SavedEvaluation> {
        Ok(SavedEvaluation {
            format_version: SAVED_VERSION,
            measured: MeasuredOn {
                data: self.data.iter().map(|path| absolute(path)).collect(),
                split: self.split.map(absolute),
                gt: self.measurement.truth.map(absolute),
                camera: camera_word(self.options.camera).into(),
                intrinsics: self.options.intrinsics,
                hfov_deg: self.options.hfov_deg,
                camera_ahead_s: self.options.camera_ahead_s,
                topics: self
                    .options
                    .topics
                    .iter()
                    .map(ToString::to_string)
                    .collect(),
                allow_holes: self.measurement.protocol.holes == Holes::Skip,
                trivial: self.measurement.baseline.map(absolute),
                engine: format!("{} {}", estimator.engine(), self.precision.name()),
                set: self.set.map(str::to_owned),
                focal_correction: self.measurement.focal_correction,
                post_process: self.measurement.post_process,
                held_out: learned_from_none(
                    model,
                    estimator.config(),
                    datasets,
                    &evaluated.places,
                )?,
                program: self.program.clone(),
                command: self.command.clone(),
                time: dates::now(),
            },
            model: ModelFile {
                sha256: model.sha256()?,
                checkpoint: match model {
                    ModelSource::Run { folder, kind, .. } => {
                        name_of(&folder.checkpoint_path(*kind))
                    }
                    ModelSource::Packed { network, .. } => network.card.name.clone(),
                },
            },
            report: evaluated.report.clone(),
            images: evaluated.images.iter().map(FrameScore::from).collect(),
        })
    }
}
