//! Hierarchical context encoding (HCE): one feature seen at several scales at once (SPEC 1.1, Eq. 11–12).

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, ConvNorm, global_mean};

/// What a [`HierarchicalContext`] is built from.
///
/// The paper's text gives the multi-scale factors 1, 3, 6 and 12, its Eq. 12 a 1×1 and 6, 12 and 18. The
/// default is a 1×1, 3, 6 and 12.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct HceConfig {
    /// The dilation of each 3×3 branch: its multi-scale factor.
    pub rates: Vec<usize>,
    /// Whether the mean over the image is a branch too.
    pub global_pool: bool,
    /// Whether the dilated branches read a 1×1 reduction to the branch width instead of the feature itself:
    /// at a ResNet-50's widths four HCEs without it cost more than the backbone.
    pub reduce_first: bool,
    /// By what a branch, and the output, has fewer channels than the feature.
    pub width_divisor: usize,
    /// The least channels that a branch, and the output, has.
    pub min_width: usize,
}

impl Default for HceConfig {
    /// 3, 6, 12 and the global mean, on a quarter of the channels but at least 32.
    fn default() -> Self {
        Self {
            rates: vec![3, 6, 12],
            global_pool: true,
            reduce_first: true,
            width_divisor: 4,
            min_width: 32,
        }
    }
}

impl HceConfig {
    /// Channels of a branch, and of the output, for a feature of `channels`.
    #[must_use]
    pub fn width(&self, channels: usize) -> usize {
        (channels / self.width_divisor.max(1)).max(self.min_width)
    }

    /// # Errors
    /// [`Error::Config`] for rates or widths that mean no network.
    pub fn validate(&self) -> Result<(), Error> {
        let in_range = |rate: &usize| (1..=64).contains(rate);
        if self.rates.len() > 8 || !self.rates.iter().all(in_range) {
            let found = &self.rates;
            return Err(Error::config(
                "hce.rates",
                "up to eight rates of 1 to 64",
                found,
            ));
        }
        if !(1..=64).contains(&self.width_divisor) {
            let found = self.width_divisor;
            return Err(Error::config("hce.width_divisor", "1 to 64", found));
        }
        if !(1..=1024).contains(&self.min_width) {
            return Err(Error::config("hce.min_width", "1 to 1024", self.min_width));
        }
        Ok(())
    }

    /// A new one for a feature of `channels`.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(
        &self,
        channels: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<HierarchicalContext, Error> {
        self.validate()?;
        let width = self.width(channels);
        let mut conv = |from: usize, to: usize, kernel: usize, rate: usize| {
            ConvNorm::new([from, to], kernel, rate, rng, device)
        };
        let point = conv(channels, width, 1, 1);
        let reduce =
            (self.reduce_first && !self.rates.is_empty()).then(|| conv(channels, width, 1, 1));
        let dilated_from = if reduce.is_some() { width } else { channels };
        let dilated: Vec<_> = self
            .rates
            .iter()
            .map(|rate| conv(dilated_from, width, 3, *rate))
            .collect();
        let branches = 1 + dilated.len() + usize::from(self.global_pool);
        let project = conv(branches * width, width, 1, 1);
        let global = self
            .global_pool
            .then(|| Conv2dConfig::new(channels, width, 1).init(rng, device));
        Ok(HierarchicalContext {
            point,
            reduce,
            dilated,
            global,
            project,
        })
    }
}

/// Branches over one feature, side by side: a 1×1, dilated 3×3 and the mean over the image.
#[derive(Module, Debug)]
pub struct HierarchicalContext {
    /// 1×1 to the branch width.
    pub point: ConvNorm,
    /// 1×1 to the branch width, read by all dilated branches.
    pub reduce: Option<ConvNorm>,
    /// 3×3, one for each rate.
    pub dilated: Vec<ConvNorm>,
    /// 1×1 on the mean over the image, with bias and without batch normalisation: one value a channel
    /// and image is too few for statistics.
    pub global: Option<Conv2d>,
    /// 1×1 over all branches.
    pub project: ConvNorm,
}

impl HierarchicalContext {
    /// H = P([B₁(x); B_d(R(x)) for each rate d; relu(W·mean(x) + b)]): B, R and P are a convolution, batch
    /// normalisation and ReLU each; the last branch stands at every pixel alike.
    ///
    /// # Shapes
    /// - `x`: `[batch, channels, height, width]`
    /// - output: `[batch, width(channels), height, width]`, see [`HceConfig::width`]
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [batch, _, height, width] = x.dims();
        let mut branches = vec![self.point.forward(x.clone())];
        let reduced = match &self.reduce {
            Some(reduce) => reduce.forward(x.clone()),
            None => x.clone(),
        };
        for dilated in &self.dilated {
            branches.push(dilated.forward(reduced.clone()));
        }
        if let Some(global) = &self.global {
            let mean = relu(global.forward(global_mean(x)));
            let channels = mean.dims()[1];
            branches.push(mean.expand([batch, channels, height, width]));
        }
        self.project.forward(Tensor::cat(branches, 1))
    }
}
