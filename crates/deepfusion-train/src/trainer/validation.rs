//! The mean loss over the held-out samples.

use crate::model::displacements;
use crate::{
    BatchLoader, DepthLoader, Error, LossTerms, Model, SampleProblem, SampleSet, Schedule,
    TrainConfig,
};
use burn::tensor::Device;

/// The mean loss over the held-out samples, with λ_v at its full weight and without the flow, which exists only in training. Also returns
/// the ratio of measured to predicted displacement; without PoseNet, of true to predicted depth; NaN if neither is known.
///
/// # Errors
/// [`Error::NoSamples`] without samples, [`Error::Data`] if an image cannot be read, [`Error::Loader`] if the
/// loader has died.
pub fn validation_loss(
    model: &Model,
    config: &TrainConfig,
    samples: &SampleSet,
    device: &Device,
) -> Result<(LossTerms, f64), Error> {
    if samples.is_empty() {
        return Err(no_samples("the held-out data"));
    }
    let (model, device) = (model.valid(device), device.clone().inner());
    let mut terms = LossTerms::default();
    let mut scale_ratio = None;
    if !samples.samples.is_empty() {
        let mut mean = Mean::default();
        let loader = BatchLoader::validation(config, samples.clone());
        let schedule = Schedule {
            speed_weight: config.loss.speed,
            masks_active: false,
        };
        while let Some(batch) = loader.next(&device) {
            let batch = model.with_learned_camera(batch?);
            let pass = model.forward(&batch);
            let (_, mut unread) = model.loss_on_device(&pass, &batch, schedule);
            if model.pose_net.is_some() {
                unread.note_displacements(displacements(&pass, &batch));
            }
            let numbers = unread.read();
            mean.add(batch.len(), &numbers.terms, numbers.scale_ratio);
        }
        scale_ratio = model.pose_net.is_some().then_some(mean.ratio());
        terms.add(&mean.terms, 1.0 / mean.count);
    }
    if !samples.depth.is_empty() {
        let mut mean = Mean::default();
        let loader = DepthLoader::validation(config, samples.depth.clone());
        while let Some(batch) = loader.next(&device) {
            let batch = batch?;
            let pass = model.learn_depth(&batch);
            mean.add(batch.len(), &pass.terms, pass.scale_ratio.ln());
        }
        scale_ratio.get_or_insert(mean.ratio().exp());
        terms.add(&mean.terms, 1.0 / mean.count);
    }
    Ok((terms, scale_ratio.unwrap_or(f64::NAN)))
}

/// Sums over the batches of a validation.
#[derive(Default)]
struct Mean {
    terms: LossTerms,
    ratio: f64,
    /// Images of the batches that have a ratio.
    with_ratio: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, images: usize, terms: &LossTerms, ratio: f64) {
        let n = images as f64;
        self.count += n;
        if !ratio.is_nan() {
            self.ratio += n * ratio;
            self.with_ratio += n;
        }
        self.terms.add(terms, n);
    }

    /// NaN if no batch has a ratio.
    fn ratio(&self) -> f64 {
        self.ratio / self.with_ratio
    }
}

pub(super) fn no_samples(data: &str) -> Error {
    Error::NoSamples {
        data: data.into(),
        reason: SampleProblem::Empty,
    }
}
