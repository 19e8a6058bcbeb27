//! Compares a network's depth with ground truth, on open recordings.

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
    /// A file of arrays with ground truth; `None`: the recordings' own, of the protocol's kind.
    pub truth: Option<&'a Path>,
    /// A file of scans for the mean-depth baseline; `None`: the scans of the recordings that the network was trained on, if they still
    /// exist.
    pub baseline: Option<&'a Path>,
    /// The protocol of the comparison.
    pub protocol: Protocol,
    /// Whether depth is corrected for a focal length other than the one trained with.
    pub focal_correction: bool,
    /// Of which predictions of an image the mean is taken (test-time augmentation).
    pub post_process: Option<PostProcess>,
    /// Whether every frame of the split must exist and have ground truth.
    pub strict: bool,
}

/// The results, and what they were measured against.
pub struct Measurement<'a> {
    /// The request.
    pub request: MeasurementRequest<'a>,
    /// The ground truth.
    pub truth: Truth,
    /// The results.
    pub evaluated: Evaluated,
    /// Set if not all frames of the split could be used.
    pub shortfall: Option<Shortfall>,
}

impl<'a> MeasurementRequest<'a> {
    /// Predicts every frame that has ground truth, and compares it and the mean-depth baseline with the ground truth. An image of another
    /// aspect ratio is stretched, so that all of its ground truth counts. `options` are those the recordings were opened with; `progress`
    /// receives the number of frames done, and of all.
    ///
    /// # Errors
    /// [`crate::Error::Incomplete`] if the whole split is required but not available; files that cannot be read; images that cannot be
    /// predicted or compared.
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
                let predicted = self.predict(estimator, dataset, frame);
                predicted.map(|(_, prediction)| prediction)
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

    /// An image and its prediction, as requested.
    fn predict(
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
    /// Adds whether the network's intervals hold. They belong to a single prediction: nothing is added for ground truth from a file of
    /// arrays, for test-time augmentation, or for a network that does not predict uncertainty. `calibrate` is as in [`intervals::measure`].
    ///
    /// # Errors
    /// A file or image that cannot be read, predicted or written.
    pub fn measure_intervals(
        &mut self,
        (model, estimator): (&ModelSource, &mut DepthEstimator),
        datasets: &[Dataset],
        calibrate: bool,
    ) -> Result<Option<(IntervalFactors, PathBuf)>> {
        let request = &self.request;
        let other_prediction = request.truth.is_some() || request.post_process.is_some();
        if other_prediction || !estimator.predicts_uncertainty() {
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
            request.predict(estimator, dataset, frame)
        })
    }
}
