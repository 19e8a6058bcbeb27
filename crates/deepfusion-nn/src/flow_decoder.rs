//! The optical-flow decoder on the depth network's encoder. Training only.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::init::{WeightInit, WeightRng};
use crate::layers::{Conv2d, Conv2dConfig};
use crate::ops::{elu, flow_coords, local_correlation, warp};
use crate::{BilinearResize, Error, FlowDecoderConfig};

/// Number of levels at which flow is predicted, coarse to fine: 1/16, 1/8 and 1/4 of the image.
pub const FLOW_LEVELS: usize = 3;

/// Enlargement from the finest level to the image.
const LAST_ENLARGEMENT: usize = 4;

/// Added to a feature's mean square before it is divided by its root.
const FEATURE_EPSILON: f64 = 1e-6;

/// Index of the encoder's feature that a level reads: those at strides 16, 8 and 4, which exist whether the encoder ends at stride 32 or
/// 16.
fn feature(level: usize) -> usize {
    FLOW_LEVELS - level
}

/// Optical flow at several sizes. u points right, v down: pixel p of the first frame lies at p + flow(p) in the second.
#[derive(Debug, Clone)]
pub struct FlowOutput {
    /// `[batch, 2, height, width]`, the image's own size, in its pixels.
    pub flow: Tensor<4>,
    /// `[batch, 2, height / s, width / s]` for s = 16, 8, 4, each in pixels of its own size; `flow` is the last one,
    /// enlarged.
    pub levels: [Tensor<4>; FLOW_LEVELS],
}

/// One level of the flow decoder.
#[derive(Module, Debug)]
pub struct FlowLevel {
    /// 1×1, from the encoder's feature to the feature that is correlated.
    pub project: Conv2d,
    /// 3×3 + ELU each.
    pub hidden: Vec<Conv2d>,
    /// 3×3 to the residual flow.
    pub output: Conv2d,
}

impl FlowLevel {
    /// The projected feature, divided by its root mean square over the channels in each pixel. The correlation of two features is then the
    /// cosine of their angle, within ±1: it depends on their similarity alone, not on the encoder's scale.
    ///
    /// # Shapes
    /// - `feature`: `[batch, channels, height, width]`
    /// - output: `[batch, feature_width, height, width]`
    fn features(&self, feature: &Tensor<4>) -> Tensor<4> {
        let x = self.project.forward(feature.clone());
        let mean_square = x.clone().mul(x.clone()).mean_dim(1);
        x.div(mean_square.add_scalar(FEATURE_EPSILON).sqrt())
    }

    /// f + residual(corr(F₀, F₁⟨p + f⟩), F₀, f).
    ///
    /// # Shapes
    /// - `first`, `second`: `[batch, feature_width, height, width]`
    /// - `flow`: `[batch, 2, height, width]`, in pixels of this size; none at the coarsest level
    /// - output: as `flow`
    fn refine(
        &self,
        first: Tensor<4>,
        second: Tensor<4>,
        flow: Option<Tensor<4>>,
        radius: usize,
    ) -> Tensor<4> {
        let (flow, second) = match flow {
            Some(flow) => (flow.clone(), warp(second, flow_coords(flow))),
            None => {
                let [batch, _, height, width] = first.dims();
                let size = [batch, 2, height, width];
                (Tensor::zeros(size, &first.device()), second)
            }
        };
        let correlation = local_correlation(first.clone(), second, radius);
        let mut x = Tensor::cat(vec![correlation, first, flow.clone()], 1);
        for conv in &self.hidden {
            x = elu(conv.forward(x));
        }
        flow.add(self.output.forward(x))
    }
}

/// Optical flow from the encoder's features of two frames, coarse to fine: at each size the second frame's features are warped by the flow
/// so far, and the displacement that a local correlation still finds is added.
#[derive(Module, Debug)]
pub struct FlowDecoder {
    /// Coarse to fine.
    pub levels: Vec<FlowLevel>,
    #[module(skip)]
    radius: usize,
}

impl FlowDecoder {
    /// A new decoder for features of `encoder_channels` (fine to coarse). Its initial flow is zero everywhere: the last convolution of
    /// every level starts at zero.
    ///
    /// # Errors
    /// As [`FlowDecoderConfig::validate`].
    pub fn new(
        config: &FlowDecoderConfig,
        encoder_channels: [usize; 5],
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        let side = 2 * config.radius + 1;
        let levels = (0..FLOW_LEVELS)
            .map(|index| {
                let from = encoder_channels[feature(index)];
                let project = Conv2dConfig::new(from, config.feature_width, 1).init(rng, device);
                // The correlation, the first frame's feature, and the flow so far.
                let mut channels_in = side * side + config.feature_width + 2;
                let hidden = config.widths.iter().map(|&width| {
                    let conv = Conv2dConfig::new(channels_in, width, 3).init(rng, device);
                    channels_in = width;
                    conv
                });
                let hidden = hidden.collect();
                let mut output = Conv2dConfig::new(channels_in, 2, 3);
                output.init = WeightInit::Zeros;
                FlowLevel {
                    project,
                    hidden,
                    output: output.init(rng, device),
                }
            })
            .collect();
        Ok(Self {
            levels,
            radius: config.radius,
        })
    }

    /// The flow from the first frame to the second.
    ///
    /// # Shapes
    /// - `first`, `second`: the features of [`ResNet::forward`](crate::ResNet::forward) for images of
    ///   `[batch, 3, height, width]`; those at strides 4, 8 and 16 are read
    /// - output: see [`FlowOutput`]
    #[must_use]
    pub fn forward(&self, first: &[Tensor<4>; 5], second: &[Tensor<4>; 5]) -> FlowOutput {
        self.decode(|index, level| {
            let k = feature(index);
            (level.features(&first[k]), level.features(&second[k]))
        })
    }

    /// The flow from the first frame to the second and the one back, in one pass over a batch twice as large.
    ///
    /// # Shapes
    /// As [`Self::forward`].
    #[must_use]
    pub fn forward_both(&self, first: &[Tensor<4>; 5], second: &[Tensor<4>; 5]) -> [FlowOutput; 2] {
        let batch = first[0].dims()[0];
        let both = self.decode(|index, level| {
            let k = feature(index);
            let features = [&first[k], &second[k]].map(|x| level.features(x));
            let [f, s] = features.clone();
            (
                Tensor::cat(features.to_vec(), 0),
                Tensor::cat(vec![s, f], 0),
            )
        });
        [0, 1].map(|direction| {
            let part = |t: Tensor<4>| t.narrow(0, direction * batch, batch);
            FlowOutput {
                flow: part(both.flow.clone()),
                levels: both.levels.clone().map(part),
            }
        })
    }

    /// Decodes the flow. `features` returns both frames' features at a level.
    fn decode(&self, features: impl Fn(usize, &FlowLevel) -> (Tensor<4>, Tensor<4>)) -> FlowOutput {
        let refine = |index: usize, flow: Option<Tensor<4>>| {
            let level = &self.levels[index];
            let (first, second) = features(index, level);
            level.refine(first, second, flow, self.radius)
        };
        let coarse = refine(0, None);
        let middle = refine(1, Some(enlarged(coarse.clone(), 2)));
        let fine = refine(2, Some(enlarged(middle.clone(), 2)));
        FlowOutput {
            flow: enlarged(fine.clone(), LAST_ENLARGEMENT),
            levels: [coarse, middle, fine],
        }
    }
}

/// The flow at `factor` times the size, bilinear with half-pixel centres. The values grow by the same factor, since pixels become smaller.
fn enlarged(flow: Tensor<4>, factor: usize) -> Tensor<4> {
    let [_, _, height, width] = flow.dims();
    let device = flow.device();
    let resize = BilinearResize::new([height, width], [factor * height, factor * width], &device);
    resize.apply(flow).mul_scalar(factor as f64)
}

#[cfg(test)]
mod tests;
