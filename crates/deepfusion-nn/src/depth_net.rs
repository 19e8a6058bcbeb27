//! DepthNet: an encoder, context and attention on its skip paths, the disparity decoder (docs/concepts/network.md).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use crate::attention::{Attention, AttentionMasks, GlobalAggregation};
use crate::decoder::DisparityDecoder;
use crate::hce::HierarchicalContext;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, freeze_statistics};
use crate::resnet::ResNet;
use crate::weights::{self, Weights};
use crate::{DepthNetConfig, Error};

/// Initial output of the uncertainty head: the expected error of ln depth, the same at every pixel.
const FIRST_SCALE: f32 = 0.2;

/// Disparity of a single image, at four scales.
#[derive(Module, Debug)]
pub struct DepthNet {
    /// The backbone.
    pub encoder: ResNet,
    /// Context encoding of the features of `layer1`…`layer4`; empty where there is none.
    pub hce: Vec<HierarchicalContext>,
    /// Attention on the same; empty where there is none.
    pub attention: Vec<Attention>,
    /// Global aggregation of the coarsest feature.
    pub aggregation: Option<GlobalAggregation>,
    /// The decoder.
    pub decoder: DisparityDecoder,
    /// 3×3 from the decoder's finest feature to ln b, b the Laplace scale of the error of ln depth.
    pub uncertainty: Option<Conv2d>,
}

/// Prefix of the tensor names of [`DepthNet::uncertainty`].
const UNCERTAINTY: &str = "uncertainty.";

/// The output of [`DepthNet::forward_with_uncertainty`].
#[derive(Debug, Clone)]
pub struct DepthOutput {
    /// Sigmoid disparities, as from [`DepthNet::forward`].
    pub disparities: Vec<Tensor<4>>,
    /// ln b of each pixel, `[batch, 1, height, width]`; `None` of a network without that head.
    pub log_scale: Option<Tensor<4>>,
}

/// What a [`DepthNet`] computes on the way from features to disparities: the paper's Fig. 5.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// The encoder's features, fine to coarse.
    pub features: [Tensor<4>; 5],
    /// What the decoder reads: the same with context, under their masks, aggregated.
    pub refined: [Tensor<4>; 5],
    /// The masks on the features of `layer1`…`layer4`; empty without attention.
    pub masks: Vec<AttentionMasks>,
}

impl DepthNet {
    /// A new network with the weights of seed 0.
    ///
    /// # Errors
    /// As [`DepthNetConfig::validate`].
    pub fn new(config: &DepthNetConfig, device: &Device) -> Result<Self, Error> {
        Self::with_seed(config, 0, device)
    }

    /// A new network whose weights depend on `seed` alone.
    ///
    /// # Errors
    /// As [`DepthNetConfig::validate`].
    pub fn with_seed(config: &DepthNetConfig, seed: u64, device: &Device) -> Result<Self, Error> {
        config.validate()?;
        let mut rng = WeightRng::new(seed);
        let encoder = ResNet::new(&config.encoder, &mut rng, device)?;
        let head_bias = config
            .initial_depth_m
            .map(|m| config.range.logit_of(m) as f32);
        let raw = config.encoder.channels();
        let refined = config.decoder_channels();
        let mut hce = Vec::new();
        let mut attention = Vec::new();
        for level in 1..5 {
            if let Some(config) = &config.hce {
                let context = HierarchicalContext::new(config, raw[level], &mut rng, device)?;
                hce.push(context);
            }
            if let Some(config) = &config.attention {
                attention.push(Attention::new(config, refined[level], &mut rng, device)?);
            }
        }
        let aggregation = config
            .aggregation
            .then(|| GlobalAggregation::new(refined[4], &mut rng, device));
        let stride = config.encoder.output_stride;
        let decoder = DisparityDecoder::new(
            &config.decoder,
            refined,
            stride,
            head_bias,
            &mut rng,
            device,
        )?;
        // Drawn last: the other weights are those of the same seed without it.
        let uncertainty = config.uncertainty.then(|| {
            let head = Conv2dConfig::new(config.decoder.widths[4], 1, 3).reflected();
            let mut head = head.init(&mut rng, device);
            head.bias = Some(Param::from_data([FIRST_SCALE.ln()], device));
            head
        });
        let net = Self {
            encoder,
            hce,
            attention,
            aggregation,
            decoder,
            uncertainty,
        };
        // The encoder has seen to its own; the context encoding has batch norms, too.
        Ok(if config.encoder.frozen_statistics {
            freeze_statistics(net, true)
        } else {
            net
        })
    }

    /// Sigmoid disparities; [`DepthRange`](deepfusion_geometry::DepthRange) turns them into metres:
    /// d = 1/D_max + (1/D_min − 1/D_max)·σ, depth = 1/d.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1], of an [`InputSize`](crate::InputSize)
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…3, finest first
    ///
    /// # Panics
    /// If the images' size is not a valid [`InputSize`](crate::InputSize); check it where it enters the program.
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        self.decode(self.encoder.forward(images))
    }

    /// As [`Self::forward`], with the uncertainty ln b: b is the expected absolute error of ln depth. No gradient passes
    /// from the uncertainty head into the decoder.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn forward_with_uncertainty(&self, images: Tensor<4>) -> DepthOutput {
        let features = self.refine(self.encoder.forward(images), |_| ());
        let (disparities, finest) = self.decoder.forward_with_feature(features);
        let head = self.uncertainty.as_ref();
        DepthOutput {
            disparities,
            log_scale: head.map(|head| head.forward(finest.detach())),
        }
    }

    /// As [`Self::forward_with_uncertainty`], for training the uncertainty head alone: the rest of the network keeps nothing for
    /// a backward pass.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn forward_for_uncertainty(&self, images: Tensor<4>) -> DepthOutput {
        let fixed = self.clone().no_grad();
        let features = fixed.refine(fixed.encoder.forward(images), |_| ());
        let (disparities, finest) = fixed.decoder.forward_with_feature(features);
        let head = self.uncertainty.as_ref();
        DepthOutput {
            disparities,
            log_scale: head.map(|head| head.forward(finest)),
        }
    }

    /// The network with these weights, which must fit it. One exception is the uncertainty head: if the weights lack it,
    /// the network keeps its own; if the network lacks it, theirs is ignored. Returns whether the head is new.
    ///
    /// # Errors
    /// As [`weights::apply`].
    pub fn with_weights(self, weights: &Weights) -> Result<(Self, bool), Error> {
        let has = |weights: &Weights| weights.tensors.keys().any(|n| n.starts_with(UNCERTAINTY));
        if self.uncertainty.is_some() == has(weights) {
            return Ok((weights::apply(self, weights)?, false));
        }
        let mut weights = weights.clone();
        match &self.uncertainty {
            None => weights.tensors.retain(|n, _| !n.starts_with(UNCERTAINTY)),
            Some(_) => {
                let own = weights::collect(&self).tensors.into_iter();
                let head = own.filter(|(name, _)| name.starts_with(UNCERTAINTY));
                weights.tensors.extend(head);
            }
        }
        let is_new = self.uncertainty.is_some();
        Ok((weights::apply(self, &weights)?, is_new))
    }

    /// As [`Self::forward`], from the encoder's features, for callers that share the encoder with another decoder.
    ///
    /// # Shapes
    /// - `features`: those of [`ResNet::forward`]
    /// - output: as [`Self::forward`]
    pub fn decode(&self, features: [Tensor<4>; 5]) -> Vec<Tensor<4>> {
        self.decoder.forward(self.refine(features, |_| ()))
    }

    /// The features of images and the attention masks on them.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn inspect(&self, images: Tensor<4>) -> Inspection {
        let features = self.encoder.forward(images);
        let mut masks = Vec::new();
        let refined = self.refine(features.clone(), |mask| masks.push(mask.clone()));
        Inspection {
            features,
            refined,
            masks,
        }
    }

    /// Context and attention on each skip path: what the decoder reads. The encoder's own layers read the
    /// raw features, so that imported weights keep their meaning.
    fn refine(
        &self,
        features: [Tensor<4>; 5],
        mut seen: impl FnMut(&AttentionMasks),
    ) -> [Tensor<4>; 5] {
        let mut level = 0;
        features.map(|raw| {
            let mut x = raw;
            if level > 0 {
                if let Some(hce) = self.hce.get(level - 1) {
                    x = hce.forward(x);
                }
                if let Some(attention) = self.attention.get(level - 1) {
                    let masks = attention.masks(&x);
                    seen(&masks);
                    x = attention.apply(x, masks);
                }
            }
            if level == 4
                && let Some(aggregation) = &self.aggregation
            {
                x = aggregation.forward(x);
            }
            level += 1;
            x
        })
    }
}

#[cfg(test)]
mod tests;
