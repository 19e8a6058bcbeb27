//! A network's depth against ground truth, on recordings that are open.

use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, OpenOptions, RgbImage};
use deepfusion_eval::{ArraySet, IntervalFactors, PostProcess, Prediction, Protocol};
use deepfusion_render::ShownFrame;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use super::{
    ChosenImage, Evaluated, Shortfall, Truth, baseline_from_arrays, baseline_from_training,
    check_used, evaluate_datasets, expected_frames, gt_kind, predict_frame, shown_of_datasets,
};
use crate::{Result, intervals};

/// What depth is compared with, and how.
#[derive(Debug, Clone)]
pub struct MeasurementRequest<'a> {
    /// A file of arrays with the truth; `None`: the recordings' own, of the protocol's kind.
    pub truth: Option<&'a Path>,
    /// A file of scans for the mean-depth baseline; `None`: those of the recordings that the network was trained on, where they are still
    /// there.
    pub baseline: Option<&'a Path>,
    /// How it is compared.
    pub protocol: Protocol,
    /// Whether depth is corrected for another focal length than the one trained on.
    pub focal_correction: bool,
    /// Of which predictions of an image the mean is taken (test-time augmentation).
    pub post_process: Option<PostProcess>,
    /// Whether every frame of the split has to be there, with ground truth.
    pub strict: bool,
}

/// What was measured, and against what.
pub struct Measurement<'a> {
    /// How it was asked for.
    pub request: MeasurementRequest<'a>,
    /// Where the truth comes from.
    pub truth: Truth,
    /// What was found.
    pub evaluated: Evaluated,
    /// That not all frames of the split could be used.
    pub shortfall: Option<Shortfall>,
}

impl<'a> MeasurementRequest<'a> {
    /// Predicts every frame that has ground truth, and compares, beside the mean-depth baseline. An image of another aspect ratio is
    /// stretched, so that all of its ground truth counts. `options` opened the recordings; `progress` takes the frames done and in all.
    ///
    /// # Errors
    /// [`crate::Error::Incomplete`] where a split has to be whole and is not; what cannot be read, predicted or compared.
    pub fn measure(
        self,
        estimator: &mut DepthEstimator,
        options: &OpenOptions,
        datasets: &[Dataset],
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Measurement<'a>> {
        let expected = expected_frames(options, datasets, self.strict)?;
        let kind = gt_kind(&self.protocol);
        let mut truth = match self.truth {
            Some(path) => Truth::Arrays(Box::new(ArraySet::open(path)?)),
            None => Truth::Scans(kind),
        };
        let baseline = match self.baseline {
            Some(path) => Some(baseline_from_arrays(path)?),
            None => baseline_from_training(estimator.config(), kind),
        };
        let mut evaluated = evaluate_datasets(
            datasets,
            &mut truth,
            &self.protocol,
            baseline,
            &mut |dataset, frame| {
                let seen = self.see(estimator, dataset, frame);
                seen.map(|(_, prediction)| prediction)
            },
            progress,
        )?;
        evaluated.report.expected = expected;
        let used = evaluated.report.n;
        let shortfall = check_used(options, datasets, used, self.strict)?;
        Ok(Measurement {
            request: self,
            truth,
            evaluated,
            shortfall,
        })
    }

    /// An image and its prediction, as they are asked for.
    fn see(
        &self,
        estimator: &mut DepthEstimator,
        dataset: &Dataset,
        frame: usize,
    ) -> Result<(RgbImage, Prediction)> {
        let (correct, how) = (self.focal_correction, self.post_process);
        predict_frame(estimator, dataset, frame, correct, how)
    }
}

impl Measurement<'_> {
    /// Adds whether the network's intervals hold, which are those of its own prediction alone: nothing against a file of arrays, of what is
    /// post-processed, or of a network that does not say how sure it is. With `calibrate` as [`intervals::measure`].
    ///
    /// # Errors
    /// What cannot be read, predicted or written.
    pub fn measure_intervals(
        &mut self,
        (model, estimator): (&ModelSource, &mut DepthEstimator),
        datasets: &[Dataset],
        calibrate: bool,
    ) -> Result<Option<(IntervalFactors, PathBuf)>> {
        let request = &self.request;
        let knows = estimator.knows_uncertainty();
        if !knows || request.truth.is_some() || request.post_process.is_some() {
            return Ok(None);
        }
        intervals::measure(
            (model, estimator),
            datasets,
            &mut self.truth,
            &mut self.evaluated,
            (&request.protocol, request.focal_correction),
            calibrate,
        )
    }

    /// The chosen images with their pictures.
    ///
    /// # Errors
    /// As [`shown_of_datasets`].
    pub fn shown(
        &mut self,
        estimator: &mut DepthEstimator,
        datasets: &[Dataset],
    ) -> Result<Vec<(ChosenImage, ShownFrame)>> {
        let Self {
            request,
            truth,
            evaluated,
            ..
        } = self;
        shown_of_datasets(datasets, truth, evaluated, |dataset, frame| {
            request.see(estimator, dataset, frame)
        })
    }
}
