//! How a loss changes the networks: its gradients by name, and the step of the optimiser.

use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;

use crate::{Adam, Model, NamedGradients};

/// The name of the focal length among parameters and moments.
pub(crate) const FOCAL: &str = "focal";

impl Model {
    /// Adds a loss' gradients to those of a step, `scale` times.
    pub fn add_gradients(&self, total: &Tensor<1>, scale: f32, step: &mut NamedGradients) {
        let mut raw = total.backward();
        step.add("depth", &self.depth_net, &mut raw, scale);
        step.add("pose", &self.pose_net, &mut raw, scale);
        if let Some(decoder) = &self.flow_decoder {
            step.add("flow", decoder, &mut raw, scale);
        }
        if let Some(focal) = &self.focal {
            step.add(FOCAL, focal, &mut raw, scale);
        }
    }

    /// The networks after a step of the optimiser. A learned focal length stays: its step is another.
    #[must_use]
    pub fn updated(self, adam: &mut Adam, step: &AdamStep, gradients: &NamedGradients) -> Self {
        Self {
            depth_net: adam.apply(step, "depth", self.depth_net, gradients),
            pose_net: adam.apply(step, "pose", self.pose_net, gradients),
            flow_decoder: self
                .flow_decoder
                .map(|decoder| adam.apply(step, "flow", decoder, gradients)),
            ..self
        }
    }
}
