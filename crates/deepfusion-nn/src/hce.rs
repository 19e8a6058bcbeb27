//! Hierarchical context encoding (HCE): one feature seen at several scales at once (the paper's Eq. 11–12).

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};

use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, ConvNorm, global_mean};
use crate::{Error, HceConfig};

/// Branches over one feature, side by side: a 1×1, dilated 3×3 and the mean over the image.
#[derive(Module, Debug)]
pub struct HierarchicalContext {
    /// 1×1 to the branch width.
    pub point: ConvNorm,
    /// 1×1 to the branch width, read by all dilated branches.
    pub reduce: Option<ConvNorm>,
    /// 3×3, one for each rate.
    pub dilated: Vec<ConvNorm>,
    /// 1×1 on the mean over the image, with bias and without batch normalisation: one value per channel and image is too few for
    /// statistics.
    pub global: Option<Conv2d>,
    /// 1×1 over all branches.
    pub project: ConvNorm,
}

impl HierarchicalContext {
    /// A new module for a feature of `channels` channels.
    ///
    /// # Errors
    /// As [`HceConfig::validate`].
    pub fn new(
        config: &HceConfig,
        channels: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        let width = config.width(channels);
        let mut conv = |from: usize, to: usize, kernel: usize, rate: usize| {
            ConvNorm::new([from, to], kernel, rate, rng, device)
        };
        let point = conv(channels, width, 1, 1);
        let reduce =
            (config.reduce_first && !config.rates.is_empty()).then(|| conv(channels, width, 1, 1));
        let dilated_from = if reduce.is_some() { width } else { channels };
        let dilated: Vec<_> = config
            .rates
            .iter()
            .map(|rate| conv(dilated_from, width, 3, *rate))
            .collect();
        let branches = 1 + dilated.len() + usize::from(config.global_pool);
        let project = conv(branches * width, width, 1, 1);
        let global = config
            .global_pool
            .then(|| Conv2dConfig::new(channels, width, 1).init(rng, device));
        Ok(Self {
            point,
            reduce,
            dilated,
            global,
            project,
        })
    }

    /// H = P([B₁(x); B_d(R(x)) for each rate d; relu(W·mean(x) + b)]): B, R and P are a convolution, batch
    /// normalisation and ReLU each; the last branch has the same value at every pixel.
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
