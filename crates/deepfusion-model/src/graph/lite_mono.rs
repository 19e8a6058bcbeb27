//! Lite-Mono's part of the graph. Per-channel factors (layer norms', layer scales) are folded into the adjacent 1×1 convolution.

use deepfusion_infer::{Activation, Border, Conv, Depthwise, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{LAYER_NORM_EPSILON, LiteMonoConfig, NetworkError, POSITION_CHANNELS};

/// A convolution of the encoder.
fn layer(
    name: String,
    offset: Offset,
    input: ValueId,
    channels: [usize; 2],
    [kernel, stride]: [usize; 2],
) -> Layer<'static> {
    Layer {
        name,
        offset,
        input,
        channels,
        kernel,
        stride,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: &Activation::Identity,
    }
}

/// A 1×1 convolution.
fn point(name: String, input: ValueId, channels: [usize; 2]) -> Layer<'static> {
    layer(name, Offset::Bias, input, channels, [1, 1])
}

impl Builder {
    /// The disparity at the image's size, and ln b with `uncertainty`.
    pub(super) fn lite_mono(
        &mut self,
        config: &LiteMonoConfig,
        uncertainty: bool,
    ) -> Result<Vec<ValueId>, NetworkError> {
        let features = self.lite_mono_encoder(config)?;
        let finest = self.lite_mono_decoder(config, features)?;
        let head = "lite_mono.decoder.heads.0";
        let large = self.enlarged_head(head, finest)?;
        // A 1×1 convolution that is the identity, followed by the sigmoid.
        let sigmoid = Layer {
            activation: &Activation::Sigmoid,
            ..point(format!("{head}.sigmoid"), large, [1, 1])
        };
        let mut outputs = vec![self.conv_with(&sigmoid, vec![1.0], vec![0.0])?];
        if uncertainty {
            outputs.push(self.enlarged_head("uncertainty", finest)?);
        }
        Ok(outputs)
    }

    /// A 3×3 convolution to one channel at half of the image's size, enlarged to the full size.
    fn enlarged_head(&mut self, name: &str, input: ValueId) -> Result<ValueId, NetworkError> {
        let channels = self.graph.shape(input).channels;
        let head = Layer {
            border: Border::Reflect,
            ..layer(name.into(), Offset::Bias, input, [channels, 1], [3, 1])
        };
        let input = self.conv(&head)?;
        self.push(format!("{name}.enlarge"), Op::Enlarge { input })
    }

    fn lite_mono_encoder(&mut self, config: &LiteMonoConfig) -> Result<[ValueId; 3], NetworkError> {
        let [first, ..] = config.widths;
        let mut x = ValueId::IMAGE;
        for (index, (from, stride)) in [(3, 2), (first, 1), (first, 1)].into_iter().enumerate() {
            let path = format!("lite_mono.encoder.stem.{index}");
            let norm = Offset::Norm(format!("{path}.bn"));
            x = self.conv(&Layer {
                activation: &Activation::Gelu,
                ..layer(format!("{path}.conv"), norm, x, [from, first], [3, stride])
            })?;
        }
        let mut image = ValueId::IMAGE;
        let mut read = vec![x];
        let mut features = [x; 3];
        for (stage, width) in config.widths.into_iter().enumerate() {
            image = self.halved(stage, image)?;
            read.push(image);
            let path = format!("lite_mono.encoder.reduce.{stage}");
            let joined = self.push(format!("{path}.concat"), Op::Concat { inputs: read })?;
            let from = self.graph.shape(joined).channels;
            let reduce = layer(path, Offset::None, joined, [from, width], [3, 2]);
            let start = self.conv(&reduce)?;
            let mut x = start;
            for block in 0..config.dilations[stage].len() {
                x = self.dilated_block(config, stage, block, x)?;
            }
            features[stage] = self.global_block(config, stage, x)?;
            read = vec![start, features[stage]];
        }
        Ok(features)
    }

    /// The mean over 3×3 pixels at stride 2.
    fn halved(&mut self, stage: usize, input: ValueId) -> Result<ValueId, NetworkError> {
        let mean = Depthwise {
            input,
            weight: vec![1.0 / 9.0; 27],
            bias: vec![0.0; 3],
            kernel: 3,
            stride: 2,
            dilation: 1,
        };
        let name = format!("lite_mono.encoder.pool.{stage}.mean");
        self.push(name, Op::Depthwise(Box::new(mean)))
    }

    fn dilated_block(
        &mut self,
        config: &LiteMonoConfig,
        stage: usize,
        block: usize,
        x: ValueId,
    ) -> Result<ValueId, NetworkError> {
        let path = format!("lite_mono.encoder.stages.{stage}.dilated.{block}");
        let width = config.widths[stage];
        let name = format!("{path}.depthwise");
        let mut weight = self.take(&format!("{name}.weight"), &[width, 1, 3, 3])?;
        let bias = self.fold(&format!("{path}.bn"), &mut weight, width)?;
        let op = Depthwise {
            input: x,
            weight,
            bias,
            kernel: 3,
            stride: 1,
            dilation: config.dilations[stage][block],
        };
        let seen = self.push(name, Op::Depthwise(Box::new(op)))?;
        let inner = config.expansion * width;
        let expand = Layer {
            activation: &Activation::Gelu,
            ..point(format!("{path}.bottleneck.expand"), seen, [width, inner])
        };
        let expanded = self.conv(&expand)?;
        let project = format!("{path}.bottleneck.project");
        let project = point(project, expanded, [inner, width]);
        self.scaled(&project, &format!("{path}.scale"), x)
    }

    fn global_block(
        &mut self,
        config: &LiteMonoConfig,
        stage: usize,
        x: ValueId,
    ) -> Result<ValueId, NetworkError> {
        let path = format!("lite_mono.encoder.stages.{stage}.global");
        let width = config.widths[stage];
        let mut placed = x;
        if stage == 0 {
            let code = Op::Position {
                per_axis: POSITION_CHANNELS,
                halvings: self.graph.shape(x).halvings,
            };
            let name = format!("{path}.position");
            let code = self.push(format!("{name}.code"), code)?;
            placed = self.conv(&Layer {
                residual: Some(x),
                ..point(name, code, [2 * POSITION_CHANNELS, width])
            })?;
        }
        let qkv = format!("{path}.attention.qkv");
        let qkv = point(qkv, placed, [width, 3 * width]);
        let input = self.after_norm(&format!("{path}.attention_norm"), qkv)?;
        let name = format!("{path}.attention");
        let temperature = self.take(&format!("{name}.temperature"), &[config.heads])?;
        let mixed = self.push(name.clone(), Op::CrossCovariance { input, temperature })?;
        let project = point(format!("{name}.project"), mixed, [width, width]);
        let mixed = self.scaled(&project, &format!("{path}.attention_scale"), placed)?;
        let inner = config.expansion * width;
        let expand = Layer {
            activation: &Activation::Gelu,
            ..point(format!("{path}.bottleneck.expand"), mixed, [width, inner])
        };
        let expanded = self.after_norm(&format!("{path}.norm"), expand)?;
        let project = format!("{path}.bottleneck.project");
        let project = point(project, expanded, [inner, width]);
        self.scaled(&project, &format!("{path}.scale"), x)
    }

    /// A 1×1 convolution of the layer norm of its input: W·(γ ⊙ n + β) + b = (W·γ)·n + (W·β + b).
    fn after_norm(&mut self, norm: &str, layer: Layer) -> Result<ValueId, NetworkError> {
        let [from, to] = layer.channels;
        let op = Op::ChannelNorm {
            input: layer.input,
            epsilon: LAYER_NORM_EPSILON as f32,
        };
        let input = self.push(norm.to_owned(), op)?;
        let layer = Layer { input, ..layer };
        let gamma = self.take(&format!("{norm}.weight"), &[from])?;
        let beta = self.take(&format!("{norm}.bias"), &[from])?;
        let (mut weight, mut bias) = self.folded(&layer, [to, from, 1, 1])?;
        for (row, bias) in weight.chunks_exact_mut(from).zip(&mut bias) {
            let products = row.iter().zip(&beta);
            let shift: f64 = products.map(|(w, b)| f64::from(*w) * f64::from(*b)).sum();
            *bias = (f64::from(*bias) + shift) as f32;
            for (w, gamma) in row.iter_mut().zip(&gamma) {
                *w *= gamma;
            }
        }
        self.conv_with(&layer, weight, bias)
    }

    /// x + γ ⊙ (W·y + b).
    fn scaled(&mut self, layer: &Layer, scale: &str, x: ValueId) -> Result<ValueId, NetworkError> {
        let [from, to] = layer.channels;
        let scale = self.take(scale, &[to])?;
        let (mut weight, mut bias) = self.folded(layer, [to, from, 1, 1])?;
        let rows = weight.chunks_exact_mut(from).zip(&mut bias);
        for ((row, bias), scale) in rows.zip(&scale) {
            row.iter_mut().for_each(|w| *w *= scale);
            *bias *= scale;
        }
        let conv = Conv {
            input: layer.input,
            weight,
            bias,
            channels_in: from,
            channels_out: to,
            kernel: 1,
            stride: 1,
            dilation: 1,
            border: Border::Zero,
            residual: Some(x),
            activation: Activation::Identity,
        };
        self.push(layer.name.clone(), Op::Conv(Box::new(conv)))
    }

    /// The feature that the finest head reads.
    fn lite_mono_decoder(
        &mut self,
        config: &LiteMonoConfig,
        [fine, middle, coarse]: [ValueId; 3],
    ) -> Result<ValueId, NetworkError> {
        let [width_0, width_1, width_2] = config.decoder_widths();
        let stages = [
            (width_2, Some(middle)),
            (width_1, Some(fine)),
            (width_0, None),
        ];
        let mut x = coarse;
        for (index, (width, skip)) in stages.into_iter().enumerate() {
            let path = format!("lite_mono.decoder.stages.{index}");
            x = self.smooth_conv(format!("{path}.reduce"), x, width)?;
            x = self.push(format!("{path}.enlarge"), Op::Enlarge { input: x })?;
            if let Some(skip) = skip {
                let inputs = vec![x, skip];
                x = self.push(format!("{path}.concat"), Op::Concat { inputs })?;
            }
            x = self.smooth_conv(format!("{path}.fuse"), x, width)?;
        }
        Ok(x)
    }

    fn smooth_conv(
        &mut self,
        name: String,
        x: ValueId,
        width: usize,
    ) -> Result<ValueId, NetworkError> {
        let channels = [self.graph.shape(x).channels, width];
        self.conv(&Layer {
            border: Border::Reflect,
            activation: &Activation::Elu,
            ..layer(name, Offset::Bias, x, channels, [3, 1])
        })
    }
}
