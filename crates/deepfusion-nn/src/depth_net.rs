//! DepthNet: an encoder and the disparity decoder (SPEC 1.1).

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use deepfusion_geometry::DepthRange;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::decoder::{DecoderConfig, DisparityDecoder};
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
            decoder: DecoderConfig::default(),
            range: DepthRange::default(),
            initial_depth_m: Some(10.0),
        }
    }

    /// Monodepth2's network: its normalisation, its range of 0.1 to 100, random head biases.
    #[must_use]
    pub fn monodepth2(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth).with_normalisation(InputNormalisation::Monodepth),
            decoder: DecoderConfig::default(),
            range: DepthRange {
                min_m: 0.1,
                max_m: 100.0,
            },
            initial_depth_m: None,
        }
    }

    /// # Errors
    /// [`Error::Config`] for a network that cannot be built, or a depth range that is none.
    pub fn validate(&self) -> Result<(), Error> {
        self.encoder.validate()?;
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
        let decoder = self
            .decoder
            .init(self.encoder.channels(), head_bias, &mut rng, device)?;
        Ok(DepthNet { encoder, decoder })
    }
}

/// Disparity of a single image, at four scales.
#[derive(Module, Debug)]
pub struct DepthNet {
    /// The backbone.
    pub encoder: ResNet,
    /// The decoder.
    pub decoder: DisparityDecoder,
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
        self.decoder.forward(features)
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
        assert_eq!(field(|c| c.decoder.widths[4] = 0), "decoder.widths");
        assert_eq!(field(|c| c.range.min_m = f64::NAN), "range");
        assert_eq!(field(|c| c.initial_depth_m = Some(95.0)), "initial_depth_m");
        assert!(good.validate().is_ok());
    }
}
