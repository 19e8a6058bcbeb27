//! What several workers hold in common.

use super::Trainer;
use crate::Error;
use crate::learned_focal::LearnedFocal;
use deepfusion_nn::weights::{apply, collect};
use std::hash::{DefaultHasher, Hash, Hasher};

impl Trainer {
    /// That all workers begin from the same.
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
        let mut settings = DefaultHasher::new();
        let config = &self.config;
        let rate = config.learning_rate.to_bits();
        (config.batch, config.accumulate, config.seed, rate).hash(&mut settings);
        (self.state.step, self.steps()).hash(&mut settings);
        // Of another assumed camera the same ln(f/f₀) is another f.
        let camera = config.assumed_camera.map(|camera| {
            let numbers = [camera.hfov_deg, camera.aspect, camera.learning_rate];
            (numbers.map(f64::to_bits), camera.learn)
        });
        camera.hash(&mut settings);
        self.workers
            .hold_the_same([weights.finish(), samples.finish(), settings.finish()])
    }

    /// Running statistics of batch norms are each worker's own between checkpoints; now they become their means.
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
