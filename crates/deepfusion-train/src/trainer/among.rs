//! What several workers share.

use super::Trainer;
use crate::Error;
use crate::learned_focal::LearnedFocal;
use deepfusion_model::TrainConfig;
use deepfusion_nn::weights::{apply, collect};
use std::hash::{DefaultHasher, Hash, Hasher};

impl Trainer {
    /// Checks that all workers have the same weights, samples and settings.
    pub(super) fn agree(&mut self) -> Result<(), Error> {
        if self.workers.count() == 1 {
            return Ok(());
        }
        let mut weights = DefaultHasher::new();
        let model = self.model();
        let focal = model.focal.as_ref().map(LearnedFocal::ratio);
        focal.map(f64::to_bits).hash(&mut weights);
        let pose = model.pose_net.as_ref().map(collect);
        let networks = [("depth", Some(collect(&model.depth_net))), ("pose", pose)];
        for (prefix, values) in networks {
            let Some(values) = values else {
                continue;
            };
            prefix.hash(&mut weights);
            for tensor in values.tensors.values() {
                tensor
                    .values
                    .iter()
                    .for_each(|v| v.to_bits().hash(&mut weights));
            }
        }
        let mut samples = DefaultHasher::new();
        (self.train.samples.len(), self.train.depth.len()).hash(&mut samples);
        for sample in &self.train.samples {
            let dataset = self.train.datasets.get(sample.dataset);
            let frame = dataset.and_then(|dataset| dataset.frames().get(sample.snippet.target));
            frame
                .map(|frame| (&frame.drive, frame.number))
                .hash(&mut samples);
        }
        for known in &self.train.depth.frames {
            let frame = known.of(&self.train.depth.datasets);
            (&frame.drive, frame.number).hash(&mut samples);
        }
        let mut settings = DefaultHasher::new();
        common(&self.config).hash(&mut settings);
        (self.state.step, self.steps()).hash(&mut settings);
        self.workers
            .check_equal([weights.finish(), samples.finish(), settings.finish()])
    }

    /// Averages the running statistics of batch norms over the workers. Between checkpoints each worker has its own.
    pub(super) fn share_statistics(&mut self) -> Result<(), Error> {
        if self.workers.count() == 1 {
            return Ok(());
        }
        let mut model = self.model().clone();
        let means = self.workers.mean_statistics(collect(&model.depth_net))?;
        model.depth_net = apply(model.depth_net, &means)?;
        if let Some(pose_net) = model.pose_net.take() {
            let means = self.workers.mean_statistics(collect(&pose_net))?;
            model.pose_net = Some(apply(pose_net, &means)?);
        }
        self.model = Some(model);
        Ok(())
    }
}

/// The part of a configuration that all workers must share: everything except paths and settings of the machine.
fn common(config: &TrainConfig) -> String {
    let mut common = config.clone();
    common.data.paths.clear();
    common.data.validation.clear();
    (common.data.split, common.data.validation_split) = (None, None);
    (common.data.loader_threads, common.data.cache_mib) = (None, None);
    for set in &mut common.data.sets {
        set.paths.clear();
        set.validation.clear();
        (set.split, set.validation_split) = (None, None);
    }
    (common.init, common.init_sha256) = (None, None);
    common.precision = Default::default();
    format!("{common:?}")
}
