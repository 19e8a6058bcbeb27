//! DispNet as in SfMLearner (Zhou et al., "Unsupervised Learning of Depth and Ego-Motion from Video", CVPR 2017): the image is halved seven
//! times and enlarged again with skip connections, without batch normalisation. Each scale reads the disparity of the next coarser one.

mod transposed;

pub use transposed::TransposedConv2d;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, activation::relu};

use crate::init::{WeightInit, WeightRng};
use crate::layers::{Conv2d, Conv2dConfig};
use crate::ops::sigmoid;
use crate::resample::doubled;
use crate::resnet::normalised;
use crate::{DispNetConfig, Error, InputNormalisation};
use deepfusion_model::{DISP_NET_DISPARITY, DISP_NET_KERNELS};

/// Two convolutions with ReLU.
#[derive(Module, Debug)]
pub struct Halving {
    /// 7×7, 5×5 or 3×3 at stride 2.
    pub halve: Conv2d,
    /// The second convolution, which keeps the size.
    pub keep: Conv2d,
}

impl Halving {
    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - output: `[batch, out, ⌈height / 2⌉, ⌈width / 2⌉]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        relu(self.keep.forward(relu(self.halve.forward(x))))
    }
}

/// A transposed convolution, then a convolution of its result and the other inputs of the same size; ReLU after both.
#[derive(Module, Debug)]
pub struct Doubling {
    /// 3×3 at stride 2, transposed.
    pub enlarge: TransposedConv2d,
    /// 3×3 of the enlarged feature and the other inputs.
    pub join: Conv2d,
}

/// Encoder, decoder and heads.
#[derive(Module, Debug)]
pub struct DispNet {
    /// Seven halvings, fine to coarse.
    pub encoder: Vec<Halving>,
    /// Seven doublings, coarse to fine.
    pub decoder: Vec<Doubling>,
    /// 3×3 to the disparities of the scales 0…3.
    pub heads: Vec<Conv2d>,
    #[module(skip)]
    normalisation: InputNormalisation,
}

/// A zero-padded convolution with Xavier's weights.
fn conv(
    channels: [usize; 2],
    (kernel, stride): (usize, usize),
    rng: &mut WeightRng,
    device: &Device,
) -> Conv2d {
    let mut config = Conv2dConfig::new(channels[0], channels[1], kernel);
    config.options.stride = stride;
    config.init = WeightInit::XavierUniform;
    config.init(rng, device)
}

impl DispNet {
    /// A new network. A `head_bias` makes each head start with that bias instead of 0.
    ///
    /// # Errors
    /// As [`DispNetConfig::validate`].
    pub fn new(
        config: &DispNetConfig,
        normalisation: InputNormalisation,
        head_bias: Option<f32>,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        let mut from = 3;
        let levels = config.widths().into_iter().zip(DISP_NET_KERNELS);
        let encoder = levels.map(|(width, kernel)| {
            let halve = conv([from, width], (kernel, 2), rng, device);
            from = width;
            let keep = conv([width; 2], (kernel, 1), rng, device);
            Halving { halve, keep }
        });
        let encoder = encoder.collect();
        let stages = config.decoder_widths().into_iter().enumerate();
        let decoder = stages.map(|(stage, width)| {
            let enlarge = TransposedConv2d::new([config.before(stage), width], rng, device);
            let coarse = usize::from(DispNetConfig::reads_disparity(stage));
            let joined = width + config.skip(stage) + coarse;
            let join = conv([joined, width], (3, 1), rng, device);
            Doubling { enlarge, join }
        });
        let decoder = decoder.collect();
        let finest_first = config.decoder_widths().into_iter().enumerate().rev();
        let with_head = finest_first.filter(|(stage, _)| DispNetConfig::scale_of(*stage).is_some());
        let heads = with_head.map(|(_, width)| {
            let mut head = conv([width, 1], (3, 1), rng, device);
            if let Some(bias) = head_bias {
                head.bias = Some(Param::from_data([bias], device));
            }
            head
        });
        Ok(Self {
            encoder,
            decoder,
            heads: heads.collect(),
            normalisation,
        })
    }

    /// The results of the halvings, fine to coarse.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: seven, `[batch, widths[k], ⌈height / 2ᵏ⁺¹⌉, ⌈width / 2ᵏ⁺¹⌉]`
    pub fn features(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        let mut x = normalised(self.normalisation, images);
        let halvings = self.encoder.iter().map(|halving| {
            x = halving.forward(x.clone());
            x.clone()
        });
        halvings.collect()
    }

    /// Sigmoid disparities, finest first, and the feature that the finest head reads.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…3; `[batch, base_width / 2, height, width]`
    ///
    /// # Panics
    /// If the images' size cannot be halved three times.
    pub fn forward_with_feature(&self, images: Tensor<4>) -> (Vec<Tensor<4>>, Tensor<4>) {
        let [_, _, height, width] = images.dims();
        let mut skips = self.features(images);
        let [factor, summand] = DISP_NET_DISPARITY;
        let mut disparities: Vec<Tensor<4>> = Vec::new();
        let mut x = skips.pop().unwrap_or_else(|| unreachable!("seven levels"));
        for (stage, doubling) in self.decoder.iter().enumerate() {
            let skip = skips.pop();
            let size = skip.as_ref().map_or([height, width], |skip| {
                let [_, _, height, width] = skip.dims();
                [height, width]
            });
            let mut joined = vec![relu(doubling.enlarge.forward(x, size))];
            joined.extend(skip);
            if let Some(disparity) = disparities.last() {
                let coarse = disparity.clone().mul_scalar(factor).add_scalar(summand);
                joined.push(doubled(coarse));
            }
            x = relu(doubling.join.forward(Tensor::cat(joined, 1)));
            if let Some(scale) = DispNetConfig::scale_of(stage) {
                disparities.push(sigmoid(self.heads[scale].forward(x.clone())));
            }
        }
        disparities.reverse();
        (disparities, x)
    }
}
