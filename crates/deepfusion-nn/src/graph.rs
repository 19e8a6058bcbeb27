//! A trained depth network as a graph, batch normalisation folded into the convolutions before it.

use deepfusion_infer::{Activation, Border, Conv, Graph, Op, ValueId};

use crate::Error;
use crate::depth_net::DepthNetConfig;
use crate::layers::BatchNorm2d;
use crate::weights::Weights;

/// The graph of a [`crate::DepthNet`] with these weights: from an RGB image to the sigmoid disparity at full
/// size.
///
/// The weights carry the network's own names (`encoder.layer1.0.conv1.weight`) and become the graph's, but for the
/// heads of the coarser scales, which are dropped.
///
/// # Errors
/// [`Error::Config`] for a network that cannot be built, [`Error::MissingTensor`] or
/// [`Error::TensorShape`] or [`Error::UnexpectedTensor`] where the weights are another network's, [`Error::NotFinite`].
pub fn depth_graph(config: &DepthNetConfig, weights: Weights) -> Result<Graph, Error> {
    config.validate()?;
    let normalisation = config.encoder.normalisation;
    let mut builder = Builder {
        graph: Graph::new(normalisation.mean(), normalisation.std()),
        weights,
    };
    let features = builder.encoder(config)?;
    let finest = builder.decoder(config, features)?;
    builder.graph.add_output(finest);
    builder.nothing_left()?;
    Ok(builder.graph)
}

struct Builder {
    graph: Graph,
    /// What was not taken yet.
    weights: Weights,
}

/// What a convolution is beside its weights.
struct Layer<'a> {
    /// Of the convolution's tensors.
    name: String,
    /// Of the batch normalisation's tensors, where one follows; a bias is read where none does.
    norm: Option<String>,
    input: ValueId,
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    border: Border,
    residual: Option<ValueId>,
    activation: &'a Activation,
}

impl Builder {
    fn encoder(&mut self, config: &DepthNetConfig) -> Result<[ValueId; 5], Error> {
        let encoder = &config.encoder;
        let width = encoder.base_width;
        let expansion = encoder.depth.expansion();
        let f0 = self.conv(&Layer {
            name: "encoder.conv1".into(),
            norm: Some("encoder.bn1".into()),
            input: ValueId::IMAGE,
            channels: [3, width],
            kernel: 7,
            stride: 2,
            border: Border::Zero,
            residual: None,
            activation: &Activation::Relu,
        })?;
        let mut features = [f0; 5];
        let mut x = self.push("encoder.maxpool".into(), Op::MaxPool { input: f0 })?;
        let mut channels = width;
        for (index, blocks) in encoder.depth.blocks().into_iter().enumerate() {
            let inner = width << index;
            for block in 0..blocks {
                let stride = if index > 0 && block == 0 { 2 } else { 1 };
                let path = format!("encoder.layer{}.{block}", index + 1);
                let outer = inner * expansion;
                x = self.block(&path, x, [channels, inner, outer], stride)?;
                channels = outer;
            }
            features[index + 1] = x;
        }
        Ok(features)
    }

    /// relu(residual(x) + shortcut(x)): a basic block where the inner and the outer channels agree.
    fn block(
        &mut self,
        path: &str,
        x: ValueId,
        [channels, inner, outer]: [usize; 3],
        stride: usize,
    ) -> Result<ValueId, Error> {
        let layer = |conv: &str, norm: &str, input, channels, kernel, stride| Layer {
            name: format!("{path}.{conv}"),
            norm: Some(format!("{path}.{norm}")),
            input,
            channels,
            kernel,
            stride,
            border: Border::Zero,
            residual: None,
            activation: &Activation::Relu,
        };
        let shortcut = if stride != 1 || channels != outer {
            self.conv(&Layer {
                activation: &Activation::Identity,
                ..layer(
                    "downsample.0",
                    "downsample.1",
                    x,
                    [channels, outer],
                    1,
                    stride,
                )
            })?
        } else {
            x
        };
        let last = if inner == outer {
            let y = self.conv(&layer("conv1", "bn1", x, [channels, inner], 3, stride))?;
            layer("conv2", "bn2", y, [inner, outer], 3, 1)
        } else {
            let y = self.conv(&layer("conv1", "bn1", x, [channels, inner], 1, 1))?;
            let y = self.conv(&layer("conv2", "bn2", y, [inner, inner], 3, stride))?;
            layer("conv3", "bn3", y, [inner, outer], 1, 1)
        };
        self.conv(&Layer {
            residual: Some(shortcut),
            ..last
        })
    }

    fn decoder(
        &mut self,
        config: &DepthNetConfig,
        [f0, f1, f2, f3, f4]: [ValueId; 5],
    ) -> Result<ValueId, Error> {
        let layer = |name: String, input, channels, activation| Layer {
            name,
            norm: None,
            input,
            channels,
            kernel: 3,
            stride: 1,
            border: Border::Reflect,
            residual: None,
            activation,
        };
        let mut x = f4;
        let skips = [Some(f3), Some(f2), Some(f1), Some(f0), None];
        for (index, skip) in skips.into_iter().enumerate() {
            let width = config.decoder.widths[index];
            let path = format!("decoder.stages.{index}");
            let channels = [self.graph.shape(x).channels, width];
            x = self.conv(&layer(
                format!("{path}.reduce"),
                x,
                channels,
                &Activation::Elu,
            ))?;
            x = self.push(
                format!("{path}.concat"),
                Op::UpsampleConcat { input: x, skip },
            )?;
            let channels = [self.graph.shape(x).channels, width];
            x = self.conv(&layer(
                format!("{path}.fuse"),
                x,
                channels,
                &Activation::Elu,
            ))?;
        }
        let channels = [config.decoder.widths[4], 1];
        self.conv(&layer(
            "decoder.heads.0".into(),
            x,
            channels,
            &Activation::Sigmoid,
        ))
    }

    fn conv(&mut self, layer: &Layer) -> Result<ValueId, Error> {
        let [channels_in, channels_out] = layer.channels;
        let shape = [channels_out, channels_in, layer.kernel, layer.kernel];
        let mut weight = self.take(&format!("{}.weight", layer.name), &shape)?;
        let bias = match &layer.norm {
            None => self.take(&format!("{}.bias", layer.name), &[channels_out])?,
            Some(norm) => self.fold(norm, &mut weight, channels_out)?,
        };
        let conv = Conv {
            input: layer.input,
            weight,
            bias,
            channels_in,
            channels_out,
            kernel: layer.kernel,
            stride: layer.stride,
            border: layer.border,
            residual: layer.residual,
            activation: *layer.activation,
        };
        self.push(layer.name.clone(), Op::Conv(Box::new(conv)))
    }

    /// γ (w ⋆ x − μ) / √(σ² + ε) + β = (s·w) ⋆ x + (β − s·μ), s = γ / √(σ² + ε). Scales the weights by s and
    /// gives the bias.
    fn fold(&mut self, norm: &str, weight: &mut [f32], channels: usize) -> Result<Vec<f32>, Error> {
        let mut of = |part: &str| self.take(&format!("{norm}.{part}"), &[channels]);
        let (gamma, beta) = (of("weight")?, of("bias")?);
        let (mean, variance) = (of("running_mean")?, of("running_var")?);
        let taps = weight.len() / channels;
        let mut bias = Vec::with_capacity(channels);
        for (c, row) in weight.chunks_exact_mut(taps).enumerate() {
            let deviation = (f64::from(variance[c]) + BatchNorm2d::EPSILON).sqrt();
            let scale = f64::from(gamma[c]) / deviation;
            for w in row {
                *w = (f64::from(*w) * scale) as f32;
            }
            bias.push((f64::from(beta[c]) - scale * f64::from(mean[c])) as f32);
        }
        Ok(bias)
    }

    /// Moves a tensor's values out of the weights: a large network lies in memory once.
    fn take(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, Error> {
        let tensor = self.weights.tensors.remove(name);
        let tensor = tensor.ok_or_else(|| Error::MissingTensor {
            origin: self.weights.origin.clone(),
            name: name.into(),
            expected: shape.to_vec(),
            others: 0,
        })?;
        if tensor.shape != shape {
            return Err(Error::TensorShape {
                origin: self.weights.origin.clone(),
                name: name.into(),
                expected: shape.to_vec(),
                found: tensor.shape,
                others: 0,
            });
        }
        let count = tensor.values.iter().filter(|v| !v.is_finite()).count();
        if count > 0 {
            return Err(Error::NotFinite {
                origin: self.weights.origin.clone(),
                name: name.into(),
                count,
            });
        }
        Ok(tensor.values)
    }

    /// That every tensor found its place, but for the heads of the coarser scales, which only training needs.
    fn nothing_left(&self) -> Result<(), Error> {
        let head = |name: &str| {
            ["1", "2", "3"]
                .map(|s| format!("decoder.heads.{s}."))
                .iter()
                .any(|h| name.starts_with(h))
        };
        let mut left = self.weights.tensors.iter().filter(|(name, _)| !head(name));
        match left.next() {
            None => Ok(()),
            Some((name, tensor)) => Err(Error::UnexpectedTensor {
                origin: self.weights.origin.clone(),
                name: name.clone(),
                found: tensor.shape.clone(),
                others: left.count(),
            }),
        }
    }

    fn push(&mut self, name: String, op: Op) -> Result<ValueId, Error> {
        Ok(self.graph.push(name, op)?)
    }
}
