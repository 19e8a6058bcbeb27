//! Layers of all networks: convolution, batch normalisation, and small operations without weights.

mod channels;
mod depthwise;

pub use channels::{Bottleneck, ChannelNorm};
pub(crate) use channels::{layer_scale, scaled};
pub use depthwise::DepthwiseConv2d;

use burn::module::{Flag, Module, ModuleMapper, Param, RunningState};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};

use crate::init::{WeightInit, WeightRng};
use crate::ops::{self, ConvOptions};

/// Configuration of a [`Conv2d`]: a square kernel, and the same stride, padding and dilation for both axes.
#[derive(Debug, Clone, Copy)]
pub struct Conv2dConfig {
    /// Channels of the input.
    pub channels_in: usize,
    /// Channels of the output.
    pub channels_out: usize,
    /// Side of the kernel, in pixels.
    pub kernel: usize,
    /// Stride, padding (zeros or reflection) and dilation.
    pub options: ConvOptions,
    /// Whether a bias is added.
    pub bias: bool,
    /// How the weights are initialised.
    pub init: WeightInit,
}

impl Conv2dConfig {
    /// A convolution of stride 1 with bias that keeps the size (odd kernels), zero-padded.
    #[must_use]
    pub fn new(channels_in: usize, channels_out: usize, kernel: usize) -> Self {
        Self {
            channels_in,
            channels_out,
            kernel,
            options: ConvOptions {
                stride: 1,
                padding: kernel / 2,
                dilation: 1,
                reflect: false,
                precision: ops::Precision::F32,
            },
            bias: true,
            init: WeightInit::UniformFanIn,
        }
    }

    /// A ResNet's convolution: no bias (a batch norm follows), Kaiming weights.
    #[must_use]
    pub fn before_batch_norm(
        channels_in: usize,
        channels_out: usize,
        kernel: usize,
        stride: usize,
    ) -> Self {
        let mut config = Self::new(channels_in, channels_out, kernel);
        config.options.stride = stride;
        config.bias = false;
        config.init = WeightInit::KaimingNormalFanOut;
        config
    }

    /// The same convolution, padded by reflection.
    #[must_use]
    pub fn reflected(mut self) -> Self {
        self.options.reflect = true;
        self
    }

    /// The same convolution with dilation `rate`, padded to keep the size; no change for a 1×1 kernel.
    #[must_use]
    pub fn dilated(mut self, rate: usize) -> Self {
        self.options.dilation = rate;
        self.options.padding = self.kernel / 2 * rate;
        self
    }

    /// The same convolution without a bias.
    #[must_use]
    pub fn without_bias(mut self) -> Self {
        self.bias = false;
        self
    }

    /// Creates the layer with random weights.
    #[must_use]
    pub fn init(&self, rng: &mut WeightRng, device: &Device) -> Conv2d {
        let area = self.kernel * self.kernel;
        let count = self.channels_out * self.channels_in * area;
        let (weight, bias) = match self.init {
            WeightInit::KaimingNormalFanOut => {
                let std = (2.0 / (self.channels_out * area) as f32).sqrt();
                (rng.normal(count, std), vec![0.0; self.channels_out])
            }
            WeightInit::UniformFanIn => {
                let bound = 1.0 / ((self.channels_in * area) as f32).sqrt();
                let weight = rng.uniform(count, bound);
                (weight, rng.uniform(self.channels_out, bound))
            }
            WeightInit::XavierUniform => {
                let (from, to) = (self.channels_in, self.channels_out);
                (rng.xavier(from * to, area, from + to), vec![0.0; to])
            }
            WeightInit::Normal2Percent => (rng.normal(count, 0.02), vec![0.0; self.channels_out]),
            WeightInit::Zeros => (vec![0.0; count], vec![0.0; self.channels_out]),
        };
        let shape = [
            self.channels_out,
            self.channels_in,
            self.kernel,
            self.kernel,
        ];
        Conv2d {
            weight: Param::from_data(TensorData::new(weight, shape), device),
            bias: self
                .bias
                .then(|| Param::from_data(TensorData::new(bias, [self.channels_out]), device)),
            options: self.options,
        }
    }
}

/// A convolution, y = w ⋆ x + b, through this crate's own operation.
#[derive(Module, Debug)]
pub struct Conv2d {
    /// `[out, in, kernel, kernel]`.
    pub weight: Param<Tensor<4>>,
    /// `[out]`.
    pub bias: Option<Param<Tensor<1>>>,
    #[module(skip)]
    options: ConvOptions,
}

impl Conv2d {
    /// # Shapes
    /// - `input`: `[batch, in, height, width]`
    /// - output: `[batch, out, ⌈height / stride⌉, ⌈width / stride⌉]` for odd kernels padded by half
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        ops::conv2d(
            input,
            self.weight.val(),
            self.bias.as_ref().map(Param::val),
            self.options,
        )
    }

    /// Stride, padding and dilation.
    #[must_use]
    pub fn options(&self) -> ConvOptions {
        self.options
    }
}

/// A convolution without bias, batch normalisation, ReLU.
#[derive(Module, Debug)]
pub struct ConvNorm {
    /// The convolution.
    pub conv: Conv2d,
    /// The batch normalisation.
    pub bn: BatchNorm2d,
}

impl ConvNorm {
    /// A new layer with dilation `rate` that keeps the size.
    #[must_use]
    pub fn new(
        [channels_in, channels_out]: [usize; 2],
        kernel: usize,
        rate: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let conv = Conv2dConfig::before_batch_norm(channels_in, channels_out, kernel, 1);
        Self {
            conv: conv.dilated(rate).init(rng, device),
            bn: BatchNorm2d::new(channels_out, device),
        }
    }

    /// relu(bn(w ⋆ x)).
    ///
    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - output: `[batch, out, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.bn.forward_relu(self.conv.forward(x))
    }
}

/// The mean over the image.
///
/// # Shapes
/// - `x`: `[batch, channels, height, width]`
/// - output: `[batch, channels, 1, 1]`
#[must_use]
pub fn global_mean(x: Tensor<4>) -> Tensor<4> {
    let [batch, channels, height, width] = x.dims();
    x.reshape([batch, channels, height * width])
        .mean_dim(2)
        .reshape([batch, channels, 1, 1])
}

/// Batch normalisation over (batch, height, width), y = γ (x − μ) / √(σ² + ε) + β, with
/// torchvision's names, ε = 1e-5 and momentum 0.1.
///
/// **Training** (the network is on an autodiff device and [`Self::training`] is set): μ and σ² are the batch's own, and the running
/// statistics move towards them, the variance in its unbiased form as in PyTorch. **Evaluation** (after [`Module::valid`], or on a plain
/// device) and **frozen statistics** ([`freeze_statistics`]): μ and σ² are the running ones and do not change. With frozen statistics γ and
/// β still learn.
#[derive(Module, Debug)]
pub struct BatchNorm2d {
    /// γ, `[channels]`.
    pub weight: Param<Tensor<1>>,
    /// β, `[channels]`.
    pub bias: Param<Tensor<1>>,
    /// Running mean, `[channels]`.
    pub running_mean: RunningState<Tensor<1>>,
    /// Running unbiased variance, `[channels]`.
    pub running_var: RunningState<Tensor<1>>,
    /// Whether the batch's own statistics are used and the running ones updated.
    pub training: Param<Flag>,
}

impl BatchNorm2d {
    /// Added to the variance.
    pub const EPSILON: f64 = deepfusion_model::BATCH_NORM_EPSILON;
    /// Weight of the new batch in the running statistics.
    pub const MOMENTUM: f64 = 0.1;

    /// A new layer: γ = 1, β = 0, mean 0, variance 1.
    #[must_use]
    pub fn new(channels: usize, device: &Device) -> Self {
        Self {
            weight: Param::from_data(TensorData::new(vec![1.0_f32; channels], [channels]), device),
            bias: Param::from_data(TensorData::new(vec![0.0_f32; channels], [channels]), device),
            running_mean: RunningState::new(Tensor::zeros([channels], device)),
            running_var: RunningState::new(Tensor::ones([channels], device)),
            training: Param::from_bool(true),
        }
    }

    /// # Shapes
    /// - `input`, output: `[batch, channels, height, width]`
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        self.normalise(input, false)
    }

    /// As [`Self::forward`], followed by a ReLU, in one pass if the batch's own statistics are used.
    ///
    /// # Shapes
    /// As [`Self::forward`].
    pub fn forward_relu(&self, input: Tensor<4>) -> Tensor<4> {
        self.normalise(input, true)
    }

    fn normalise(&self, input: Tensor<4>, with_relu: bool) -> Tensor<4> {
        let (gamma, beta) = (self.weight.val(), self.bias.val());
        if !(self.training.is_enabled() && input.is_autodiff()) {
            // One multiplication and one addition per pixel: y = x·s + (β − μ·s), s = γ / √(σ² + ε).
            let channels = gamma.dims()[0];
            let deviation = self.running_var.value().add_scalar(Self::EPSILON).sqrt();
            let scale = gamma.div(deviation);
            let shift = beta.sub(self.running_mean.value().mul(scale.clone()));
            let output = input
                .mul(scale.reshape([1, channels, 1, 1]))
                .add(shift.reshape([1, channels, 1, 1]));
            return if with_relu { relu(output) } else { output };
        }
        let [batch, _, height, width] = input.dims();
        let result = ops::batch_norm(input, gamma, beta, Self::EPSILON, with_relu);
        let count = (batch * height * width) as f64;
        // A single value has no unbiased variance; the biased one, 0, is used.
        let unbiased = count / (count - 1.0).max(1.0);
        let batch = [result.mean, result.variance];
        self.move_statistics_towards(batch, unbiased);
        result.output
    }

    /// running ← (1 − m)·running + m·batch, visible to the next reader at once.
    fn move_statistics_towards(&self, batch: [Tensor<1>; 2], unbiased: f64) {
        let both = [&self.running_mean, &self.running_var];
        let old = both.map(RunningState::value);
        let new = ops::running_statistics(old, batch, Self::MOMENTUM, unbiased);
        for (running, value) in both.into_iter().zip(new) {
            // `update` would divide the value by the number of threads that set one (an extra launch on a GPU), and stay pending until the
            // next step. The clone shares the value with the original.
            running.clone().map(&mut Replace(Some(value)));
        }
    }
}

/// Replaces the value of a running statistic.
struct Replace(Option<Tensor<1>>);

impl ModuleMapper for Replace {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match self.0.take() {
            Some(value) => param.map(|old| value.reshape(old.dims())),
            None => param,
        }
    }
}

/// The module with every batch norm's statistics frozen (`true`) or following the batches again
/// (`false`). Everything else, gradients included, stays as it is.
pub fn freeze_statistics<M: Module>(module: M, frozen: bool) -> M {
    struct SetTraining(bool);
    impl ModuleMapper for SetTraining {
        fn map_flag(&mut self, flag: Param<Flag>) -> Param<Flag> {
            flag.with_value(self.0)
        }
    }
    module.map(&mut SetTraining(!frozen))
}
