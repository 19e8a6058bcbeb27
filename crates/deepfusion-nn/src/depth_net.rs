//! DepthNet: an encoder, context and attention on its skip paths, the disparity decoder; or Lite-Mono, R-MSFM, DispNet
//! (docs/concepts/network.md).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use crate::attention::{Attention, AttentionMasks, GlobalAggregation};
use crate::decoder::DisparityDecoder;
use crate::disp_net::DispNet;
use crate::hce::HierarchicalContext;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, freeze_statistics};
use crate::lite_mono::LiteMono;
use crate::r_msfm::RMsfm;
use crate::resample::doubled;
use crate::resnet::ResNet;
use crate::weights::{self, Weights};
use crate::{ArchitectureProblem, DepthNetConfig, Error};
use deepfusion_model::{DISP_NET_LEVELS, UNCERTAINTY_PREFIX};

/// Initial output of the uncertainty head at every pixel: the expected error of ln depth.
const FIRST_SCALE: f32 = 0.2;

/// Disparity of a single image: a ResNet and its decoder or DispNet at four scales, Lite-Mono at three, or R-MSFM's refinements.
#[derive(Module, Debug)]
pub struct DepthNet {
    /// Lite-Mono. If present, all other parts except the uncertainty head are absent.
    pub lite_mono: Option<LiteMono>,
    /// R-MSFM. If present, all other parts are absent.
    pub r_msfm: Option<RMsfm>,
    /// DispNet. If present, all other parts except the uncertainty head are absent.
    pub disp_net: Option<DispNet>,
    /// The ResNet encoder.
    pub encoder: Option<ResNet>,
    /// Context encoding of the features of `layer1`…`layer4`; empty without it.
    pub hce: Vec<HierarchicalContext>,
    /// Attention on the same features; empty without it.
    pub attention: Vec<Attention>,
    /// Global aggregation of the coarsest feature.
    pub aggregation: Option<GlobalAggregation>,
    /// The ResNet's decoder.
    pub decoder: Option<DisparityDecoder>,
    /// 3×3 from the decoder's finest feature to ln b, b the Laplace scale of the error of ln depth. Lite-Mono's feature has half of
    /// the image's size; ln b is then enlarged.
    pub uncertainty: Option<Conv2d>,
}

/// The output of [`DepthNet::forward_with_uncertainty`].
#[derive(Debug, Clone)]
pub struct DepthOutput {
    /// Sigmoid disparities, as from [`DepthNet::forward`].
    pub disparities: Vec<Tensor<4>>,
    /// ln b of each pixel, `[batch, 1, height, width]`; `None` for a network without uncertainty head.
    pub log_scale: Option<Tensor<4>>,
}

/// Intermediate results of a [`DepthNet`] between features and disparities: the paper's Fig. 5.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// The encoder's features, fine to coarse: five for a ResNet, three for Lite-Mono and R-MSFM, seven for DispNet.
    pub features: Vec<Tensor<4>>,
    /// What the decoder reads: the features after context encoding, attention and aggregation.
    pub refined: Vec<Tensor<4>>,
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
        let head_bias = config
            .initial_depth_m
            .map(|m| config.range.logit_of(m) as f32);
        let normalisation = config.encoder.normalisation;
        let mut net = if let Some(r_msfm) = &config.r_msfm {
            let start = head_bias.unwrap_or(0.0);
            let body = RMsfm::new(r_msfm, normalisation, start, &mut rng, device)?;
            Self {
                r_msfm: Some(body),
                ..Self::empty()
            }
        } else if let Some(disp_net) = &config.disp_net {
            let body = DispNet::new(disp_net, normalisation, head_bias, &mut rng, device)?;
            Self {
                disp_net: Some(body),
                ..Self::empty()
            }
        } else if let Some(lite_mono) = &config.lite_mono {
            let body = LiteMono::new(lite_mono, normalisation, head_bias, &mut rng, device)?;
            Self {
                lite_mono: Some(body),
                ..Self::empty()
            }
        } else {
            Self::with_resnet(config, head_bias, &mut rng, device)?
        };
        let finest = match (&config.lite_mono, &config.disp_net) {
            (Some(lite_mono), _) => lite_mono.decoder_widths()[0],
            (None, Some(disp_net)) => disp_net.decoder_widths()[DISP_NET_LEVELS - 1],
            (None, None) => config.decoder.widths[4],
        };
        // Drawn last, so that the other weights are the same for a seed with or without it.
        net.uncertainty = config.uncertainty.then(|| {
            let head = Conv2dConfig::new(finest, 1, 3).reflected();
            let mut head = head.init(&mut rng, device);
            head.bias = Some(Param::from_data([FIRST_SCALE.ln()], device));
            head
        });
        // A ResNet freezes its own batch norms; other networks have batch norms, too.
        Ok(if config.encoder.frozen_statistics {
            freeze_statistics(net, true)
        } else {
            net
        })
    }

    /// A network without any part.
    fn empty() -> Self {
        Self {
            lite_mono: None,
            r_msfm: None,
            disp_net: None,
            encoder: None,
            hce: Vec::new(),
            attention: Vec::new(),
            aggregation: None,
            decoder: None,
            uncertainty: None,
        }
    }

    /// A ResNet and its decoder, without the uncertainty head.
    fn with_resnet(
        config: &DepthNetConfig,
        head_bias: Option<f32>,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        let encoder = ResNet::new(&config.encoder, rng, device)?;
        let raw = config.encoder.channels();
        let refined = config.decoder_channels();
        let mut hce = Vec::new();
        let mut attention = Vec::new();
        for level in 1..5 {
            if let Some(config) = &config.hce {
                let context = HierarchicalContext::new(config, raw[level], rng, device)?;
                hce.push(context);
            }
            if let Some(config) = &config.attention {
                attention.push(Attention::new(config, refined[level], rng, device)?);
            }
        }
        let aggregation = config
            .aggregation
            .then(|| GlobalAggregation::new(refined[4], rng, device));
        let stride = config.encoder.output_stride;
        let decoder =
            DisparityDecoder::new(&config.decoder, refined, stride, head_bias, rng, device)?;
        Ok(Self {
            encoder: Some(encoder),
            hce,
            attention,
            aggregation,
            decoder: Some(decoder),
            ..Self::empty()
        })
    }

    /// Sigmoid disparities; [`DepthRange`](deepfusion_geometry::DepthRange) turns them into metres:
    /// d = 1/D_max + (1/D_min − 1/D_max)·σ, depth = 1/d.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1], of an [`InputSize`](crate::InputSize)
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…3 (of Lite-Mono 0…2), finest first; of R-MSFM s = 0 for
    ///   each refinement, the last one first ([`DepthNetConfig::scales`])
    ///
    /// # Panics
    /// If the images' size is not a valid [`InputSize`](crate::InputSize); check it where it enters the program.
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        match &self.r_msfm {
            Some(net) => net.forward(images),
            None => self.forward_with_feature(images).0,
        }
    }

    /// Disparities, and the feature that the finest head reads; R-MSFM has none.
    fn forward_with_feature(&self, images: Tensor<4>) -> (Vec<Tensor<4>>, Tensor<4>) {
        match (&self.lite_mono, &self.disp_net) {
            (Some(net), _) => {
                let features = net.encoder.forward(images);
                net.decoder.forward_with_feature(features)
            }
            (None, Some(net)) => net.forward_with_feature(images),
            (None, None) => {
                let (encoder, decoder) = self.resnet();
                decoder.forward_with_feature(self.refine(encoder.forward(images), |_| ()))
            }
        }
    }

    #[expect(
        clippy::expect_used,
        reason = "a network that is not Lite-Mono, R-MSFM or DispNet has both"
    )]
    fn resnet(&self) -> (&ResNet, &DisparityDecoder) {
        let (encoder, decoder) = (self.encoder.as_ref(), self.decoder.as_ref());
        let both = encoder.zip(decoder);
        both.expect("a network has a ResNet and its decoder, or is Lite-Mono, R-MSFM or DispNet")
    }

    /// ln b of the finest feature.
    fn log_scale(&self, finest: Tensor<4>) -> Option<Tensor<4>> {
        let small = self.uncertainty.as_ref()?.forward(finest);
        Some(match &self.lite_mono {
            Some(_) => doubled(small),
            None => small,
        })
    }

    /// As [`Self::forward`], with the uncertainty ln b: b is the expected absolute error of ln depth. No gradient passes
    /// from the uncertainty head into the decoder.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn forward_with_uncertainty(&self, images: Tensor<4>) -> DepthOutput {
        if self.uncertainty.is_none() {
            return DepthOutput {
                disparities: self.forward(images),
                log_scale: None,
            };
        }
        let (disparities, finest) = self.forward_with_feature(images);
        DepthOutput {
            disparities,
            log_scale: self.log_scale(finest.detach()),
        }
    }

    /// As [`Self::forward_with_uncertainty`], for training the uncertainty head alone. The rest of the network runs as in inference: it
    /// uses its running statistics without updating them, and keeps nothing for a backward pass.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn forward_for_uncertainty(&self, images: Tensor<4>) -> DepthOutput {
        let fixed = freeze_statistics(self.clone().no_grad(), true);
        let (disparities, finest) = fixed.forward_with_feature(images);
        DepthOutput {
            disparities,
            log_scale: self.log_scale(finest),
        }
    }

    /// The network with these weights, which must fit it, except for the uncertainty head. If the weights lack the head, the network keeps
    /// its own; if the network lacks it, the weights' head is ignored. Returns whether the head is new.
    ///
    /// # Errors
    /// As [`weights::apply`].
    pub fn with_weights(self, weights: &Weights) -> Result<(Self, bool), Error> {
        weights::apply_but_for(self, weights, UNCERTAINTY_PREFIX)
    }

    /// The kind of network, for messages.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match (&self.lite_mono, &self.r_msfm, &self.disp_net) {
            (Some(_), ..) => "Lite-Mono",
            (_, Some(_), _) => "R-MSFM",
            (.., Some(_)) => "DispNet",
            _ => "a ResNet's",
        }
    }

    /// The features of a ResNet, for callers that share the encoder with another decoder.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    /// - output: as from [`ResNet::forward`]
    ///
    /// # Panics
    /// If the network is Lite-Mono, R-MSFM or DispNet; else as [`Self::forward`].
    pub fn encode(&self, images: Tensor<4>) -> [Tensor<4>; 5] {
        self.resnet().0.forward(images)
    }

    /// As [`Self::forward`], from [`Self::encode`]'s features.
    ///
    /// # Shapes
    /// - `features`: those of [`Self::encode`]
    /// - output: as [`Self::forward`]
    ///
    /// # Panics
    /// If the network is Lite-Mono, R-MSFM or DispNet.
    pub fn decode(&self, features: [Tensor<4>; 5]) -> Vec<Tensor<4>> {
        self.resnet().1.forward(self.refine(features, |_| ()))
    }

    /// The network with weights of torchvision's ResNet in its encoder.
    ///
    /// # Errors
    /// As [`weights::load_torchvision_resnet`], or [`weights::load_torchvision_half`] for R-MSFM; [`Error::UnknownArchitecture`] if the network
    /// is Lite-Mono or DispNet.
    pub fn with_torchvision_encoder(mut self, path: &std::path::Path) -> Result<Self, Error> {
        if let Some(net) = &mut self.r_msfm {
            net.encoder = weights::load_torchvision_half(net.encoder.clone(), path)?;
            return Ok(self);
        }
        let kind = self.kind();
        let encoder = self
            .encoder
            .take()
            .ok_or_else(|| Error::UnknownArchitecture {
                origin: path.display().to_string(),
                reason: ArchitectureProblem::ResNetForOther { network: kind },
            })?;
        self.encoder = Some(weights::load_torchvision_resnet(encoder, path)?);
        Ok(self)
    }

    /// The features of images and the attention masks on them.
    ///
    /// # Shapes
    /// - `images`: as for [`Self::forward`]
    pub fn inspect(&self, images: Tensor<4>) -> Inspection {
        let mut masks = Vec::new();
        if let Some(net) = &self.disp_net {
            let features = net.features(images);
            return Inspection {
                refined: features.clone(),
                features,
                masks,
            };
        }
        let (features, refined) = match (&self.lite_mono, &self.r_msfm) {
            (Some(net), _) => {
                let features = net.encoder.forward(images);
                (features.clone(), features)
            }
            (None, Some(net)) => {
                let features = net.encoder.forward(images).to_vec();
                (features.clone(), features)
            }
            (None, None) => {
                let features = self.encode(images);
                let refined = self.refine(features.clone(), |mask| masks.push(mask.clone()));
                (features.to_vec(), refined.to_vec())
            }
        };
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
