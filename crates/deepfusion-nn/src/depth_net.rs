//! DepthNet: an encoder, context and attention on its skip paths, the disparity decoder (SPEC 1.1).

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use deepfusion_geometry::DepthRange;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::attention::{Attention, AttentionConfig, AttentionMasks, GlobalAggregation};
use crate::decoder::{DecoderConfig, DisparityDecoder};
use crate::hce::{HceConfig, HierarchicalContext};
use crate::init::WeightRng;
use crate::resnet::{InputNormalisation, ResNet, ResNetConfig, ResNetDepth};

/// The size of the images a network is given, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
        Ok(DepthNet {
            encoder,
            hce,
            attention,
            aggregation,
            decoder,
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
mod tests {
    use super::*;

    #[test]
    fn sizes_that_do_not_halve_five_times_are_refused_with_the_nearest_that_does() {
        assert!(InputSize::new(640, 192).is_ok());
        let error = InputSize::new(1242, 375).unwrap_err();
        assert!(error.to_string().contains("1242×375"), "{error}");
        assert_eq!(error.hint().as_deref(), Some("the nearest is 1248×384"));
        assert!(InputSize::new(64, 32).is_err());
    }

    #[test]
    fn a_config_without_the_optional_fields_is_the_published_network() {
        let config: DepthNetConfig =
            serde_json::from_str(r#"{"encoder": {"depth": "resnet18"}, "initial_depth_m": 10.0}"#)
                .unwrap();
        assert_eq!(config, DepthNetConfig::new(ResNetDepth::ResNet18));
    }

    /// Every part is one switch, and what is off leaves no tensor behind.
    #[test]
    fn each_part_is_switched_on_its_own() {
        let device = Device::flex();
        let image = Tensor::<4>::ones([1, 3, 64, 96], &device).mul_scalar(0.5);
        let names = |config: &DepthNetConfig| {
            let net = config.init(&device).unwrap();
            let disparities = net.forward(image.clone());
            for (s, disparity) in disparities.iter().enumerate() {
                assert_eq!(disparity.dims(), [1, 1, 64 >> s, 96 >> s]);
            }
            crate::weights::collect(&net).tensors
        };
        let mut plain = DepthNetConfig::new(ResNetDepth::ResNet18);
        plain.encoder.base_width = 8;
        plain.decoder.widths = [8; 5];
        let without = names(&plain);
        let prefixes = ["hce.", "attention.", "aggregation."];
        let parts: [fn(&mut DepthNetConfig); 4] = [
            |c| c.hce = Some(HceConfig::default()),
            |c| c.attention = Some(AttentionConfig::default()),
            |c| c.aggregation = true,
            |c| c.encoder.output_stride = 16,
        ];
        for (i, part) in parts.iter().enumerate() {
            let mut config = plain.clone();
            part(&mut config);
            let with = names(&config);
            for (k, prefix) in prefixes.iter().enumerate() {
                let there = with.keys().any(|name| name.starts_with(prefix));
                assert_eq!(there, k == i, "{prefix} in part {i}");
            }
            // The encoder's weights are the same ones, dilated or not.
            for (name, tensor) in without.iter().filter(|(n, _)| n.starts_with("encoder.")) {
                assert!(with[name] == *tensor, "{name}");
            }
        }
        for prefix in prefixes {
            assert!(!without.keys().any(|name| name.starts_with(prefix)));
        }
    }

    #[test]
    fn the_papers_config_survives_its_file() {
        let config = DepthNetConfig::paper();
        config.validate().unwrap();
        assert_eq!(config.decoder_channels(), [64, 64, 128, 256, 512]);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(
            serde_json::from_str::<DepthNetConfig>(&text).unwrap(),
            config
        );
    }

    #[test]
    fn configs_that_mean_no_network_are_refused_by_field() {
        let good = DepthNetConfig::new(ResNetDepth::ResNet18);
        let field = |change: fn(&mut DepthNetConfig)| {
            let mut config = good.clone();
            change(&mut config);
            match config.validate() {
                Err(Error::Config { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(field(|c| c.encoder.base_width = 0), "encoder.base_width");
        assert_eq!(field(|c| c.encoder.frames = 2), "encoder.frames");
        assert_eq!(
            field(|c| c.encoder.output_stride = 8),
            "encoder.output_stride"
        );
        assert_eq!(field(|c| c.encoder.multi_grid[1] = 0), "encoder.multi_grid");
        let hce = |change: fn(&mut HceConfig)| {
            let mut config = HceConfig::default();
            change(&mut config);
            config
        };
        let mut config = good.clone();
        config.hce = Some(hce(|c| c.rates = vec![3, 0]));
        assert!(
            config
                .validate()
                .unwrap_err()
                .to_string()
                .contains("hce.rates")
        );
        config.hce = Some(hce(|c| c.width_divisor = 0));
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("hce.width_divisor"), "{error}");
        config.hce = Some(hce(|c| c.min_width = 0));
        assert!(
            config
                .validate()
                .unwrap_err()
                .to_string()
                .contains("hce.min_width")
        );
        config.hce = None;
        config.attention = Some(AttentionConfig {
            kernel: 6,
            ..AttentionConfig::default()
        });
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("attention.kernel"), "{error}");
        assert_eq!(field(|c| c.decoder.widths[4] = 0), "decoder.widths");
        assert_eq!(field(|c| c.range.min_m = f64::NAN), "range");
        assert_eq!(field(|c| c.initial_depth_m = Some(95.0)), "initial_depth_m");
        assert!(good.validate().is_ok());
    }
}
