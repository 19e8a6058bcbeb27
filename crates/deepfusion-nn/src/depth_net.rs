//! DepthNet: an encoder, context and attention on its skip paths, the disparity decoder (SPEC 1.1).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use deepfusion_geometry::DepthRange;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::attention::{Attention, AttentionConfig, AttentionMasks, GlobalAggregation};
use crate::decoder::{DecoderConfig, DisparityDecoder};
use crate::hce::{HceConfig, HierarchicalContext};
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, freeze_statistics};
use crate::resnet::{InputNormalisation, ResNet, ResNetConfig, ResNetDepth};
use crate::weights::{self, Weights};

/// The error of ln depth that the head for uncertainty starts at everywhere.
const FIRST_SCALE: f32 = 0.2;

/// The size of the images a network is given, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct InputSize {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl InputSize {
    /// A size that the encoder can halve five times.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn new(width: usize, height: usize) -> Result<Self, Error> {
        let size = Self { width, height };
        size.validate()?;
        Ok(size)
    }

    /// The coarsest feature has 1/32 of the size; the decoder's reflection padding needs two of its
    /// pixels in each direction.
    ///
    /// # Errors
    /// [`Error::InputSize`] unless both sides are multiples of 32 and at least 64.
    pub fn validate(&self) -> Result<(), Error> {
        let fits = |n: usize| n >= 64 && n.is_multiple_of(32);
        if fits(self.width) && fits(self.height) {
            Ok(())
        } else {
            Err(Error::InputSize {
                width: self.width,
                height: self.height,
            })
        }
    }
}

/// What a [`DepthNet`] is built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DepthNetConfig {
    /// The backbone.
    pub encoder: ResNetConfig,
    /// Hierarchical context encoding of the features of `layer1`…`layer4` on their way to the decoder;
    /// absent: the decoder reads the features as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hce: Option<HceConfig>,
    /// Attention on what the context encoding gives (or on the features themselves); absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<AttentionConfig>,
    /// Whether the mean of the coarsest feature over the image is projected and added to it.
    #[serde(default)]
    pub aggregation: bool,
    /// The decoder.
    #[serde(default)]
    pub decoder: DecoderConfig,
    /// The depths that the ends of the sigmoid mean.
    #[serde(default)]
    pub range: DepthRange,
    /// The depth in metres that a new network starts at everywhere, by the heads' bias; absent: the
    /// heads start with a random bias.
    ///
    /// With a bias near zero the first depths are about 0.2 m, and a metric pose then projects every
    /// pixel out of view: nothing is left to learn from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_depth_m: Option<f64>,
    /// Whether a further head says how sure the network is of each pixel.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub uncertainty: bool,
}

impl DepthNetConfig {
    /// The published ResNet with the decoder's full widths, 0.1 to 90 m, starting at 10 m.
    #[must_use]
    pub fn new(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth),
            hce: None,
            attention: None,
            aggregation: false,
            decoder: DecoderConfig::default(),
            range: DepthRange::default(),
            initial_depth_m: Some(10.0),
            uncertainty: false,
        }
    }

    /// The paper's network (its Fig. 3): ResNet-50 at output stride 16, context encoding, attention and
    /// aggregation, 0.1 to 90 m, starting at 10 m.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            encoder: ResNetConfig::new(ResNetDepth::ResNet50).with_output_stride(16),
            hce: Some(HceConfig::default()),
            attention: Some(AttentionConfig::default()),
            aggregation: true,
            ..Self::new(ResNetDepth::ResNet50)
        }
    }

    /// Monodepth2's network: its normalisation, its range of 0.1 to 100, random head biases.
    #[must_use]
    pub fn monodepth2(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth).with_normalisation(InputNormalisation::Monodepth),
            range: DepthRange {
                min_m: 0.1,
                max_m: 100.0,
            },
            initial_depth_m: None,
            ..Self::new(depth)
        }
    }

    /// # Errors
    /// [`Error::Config`] for a network that cannot be built, or a depth range that is none.
    pub fn validate(&self) -> Result<(), Error> {
        self.encoder.validate()?;
        self.hce.as_ref().map_or(Ok(()), HceConfig::validate)?;
        self.attention
            .as_ref()
            .map_or(Ok(()), AttentionConfig::validate)?;
        self.decoder.validate()?;
        if self.encoder.frames != 1 {
            return Err(Error::config(
                "encoder.frames",
                "1 (a depth network sees one image)",
                self.encoder.frames,
            ));
        }
        let DepthRange { min_m, max_m } = self.range;
        if !(min_m > 0.0 && max_m > min_m && max_m.is_finite()) {
            return Err(Error::config(
                "range",
                "0 < min_m < max_m, finite",
                self.range,
            ));
        }
        match self.initial_depth_m {
            Some(depth) if !(depth > min_m && depth < max_m) => Err(Error::config(
                "initial_depth_m",
                format!("between {min_m} and {max_m} m, the ends of the range"),
                depth,
            )),
            _ => Ok(()),
        }
    }

    /// Channels of the features that the decoder reads, fine to coarse.
    #[must_use]
    pub fn decoder_channels(&self) -> [usize; 5] {
        let mut channels = self.encoder.channels();
        if let Some(hce) = &self.hce {
            for channels in &mut channels[1..] {
                *channels = hce.width(*channels);
            }
        }
        channels
    }

    /// A new network with the weights of seed 0.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(&self, device: &Device) -> Result<DepthNet, Error> {
        self.init_with_seed(0, device)
    }

    /// A new network whose weights depend on `seed` alone.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init_with_seed(&self, seed: u64, device: &Device) -> Result<DepthNet, Error> {
        self.validate()?;
        let mut rng = WeightRng::new(seed);
        let encoder = self.encoder.init(&mut rng, device)?;
        let head_bias = self.initial_depth_m.map(|m| self.range.logit_of(m) as f32);
        let raw = self.encoder.channels();
        let refined = self.decoder_channels();
        let mut hce = Vec::new();
        let mut attention = Vec::new();
        for level in 1..5 {
            if let Some(config) = &self.hce {
                hce.push(config.init(raw[level], &mut rng, device)?);
            }
            if let Some(config) = &self.attention {
                attention.push(config.init(refined[level], &mut rng, device)?);
            }
        }
        let aggregation = self
            .aggregation
            .then(|| GlobalAggregation::new(refined[4], &mut rng, device));
        let stride = self.encoder.output_stride;
        let decoder = self
            .decoder
            .init(refined, stride, head_bias, &mut rng, device)?;
        // Drawn last: the other weights are those of the same seed without it.
        let uncertainty = self.uncertainty.then(|| {
            let head = Conv2dConfig::new(self.decoder.widths[4], 1, 3).reflected();
            let mut head = head.init(&mut rng, device);
            head.bias = Some(Param::from_data([FIRST_SCALE.ln()], device));
            head
        });
        let net = DepthNet {
            encoder,
            hce,
            attention,
            aggregation,
            decoder,
            uncertainty,
        };
        // The encoder has seen to its own; the context encoding has batch norms, too.
        Ok(match self.encoder.frozen_statistics {
            true => freeze_statistics(net, true),
            false => net,
        })
    }
}

/// Disparity of a single image, at four scales.
#[derive(Module, Debug)]
pub struct DepthNet {
    /// The backbone.
    pub encoder: ResNet,
    /// Context encoding of the features of `layer1`…`layer4`; empty where there is none.
    pub hce: Vec<HierarchicalContext>,
    /// Attention on the same; empty where there is none.
    pub attention: Vec<Attention>,
    /// Of the coarsest feature.
    pub aggregation: Option<GlobalAggregation>,
    /// The decoder.
    pub decoder: DisparityDecoder,
    /// 3×3 from the decoder's finest feature to ln b, b the Laplace scale of the error of ln depth.
    pub uncertainty: Option<Conv2d>,
}

/// The tensors of [`DepthNet::uncertainty`] begin so.
const UNCERTAINTY: &str = "uncertainty.";

/// What [`DepthNet::forward_with_uncertainty`] says of images.
#[derive(Debug, Clone)]
pub struct DepthOutput {
    /// As [`DepthNet::forward`] gives them.
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
    /// Sigmoid disparities; [`DepthRange`] turns them into metres:
    /// d = 1/D_max + (1/D_min − 1/D_max)·σ, depth = 1/d.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1], of an [`InputSize`]
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…3, finest first
    ///
    /// # Panics
    /// When the images' size is no [`InputSize`]; check it where it enters the program.
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        self.decode(self.encoder.forward(images))
    }

    /// The same, and how sure the network is: it errs by b in ln depth, in the mean. What the head learns changes nothing
    /// else: no gradient passes from it into the decoder.
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

    /// The same where the head for uncertainty alone learns: of everything else nothing is kept for a backward pass.
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

    /// The network with these weights, which must be its own; but a network with the head for uncertainty may take the
    /// weights of one without, and keeps its own head then, and one without leaves the other's head aside. Says whether the
    /// head is new.
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

    /// The same from the encoder's features, for whoever shares the encoder with another decoder.
    ///
    /// # Shapes
    /// - `features`: those of [`ResNet::forward`]
    /// - output: as [`Self::forward`]
    pub fn decode(&self, features: [Tensor<4>; 5]) -> Vec<Tensor<4>> {
        self.decoder.forward(self.refine(features, |_| ()))
    }

    /// The features of images and where the network looks in them.
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
