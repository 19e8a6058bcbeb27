//! A trained depth network as a graph, with each batch normalisation folded into the convolution before it.

use std::collections::BTreeMap;

use deepfusion_infer::{Activation, Border, Conv, Graph, Op, ValueId};

mod decoder;
mod disp_net;
mod encoder;
mod lite_mono;
mod r_msfm;
mod skips;

use crate::network::{BATCH_NORM_EPSILON, UNCERTAINTY_PREFIX};
use crate::weights::Weights;
use crate::{DepthNetConfig, NetworkError};

/// The graph of a depth network with these weights: from an RGB image to the sigmoid disparity at full
/// size.
///
/// The weights have the network's own names (`encoder.layer1.0.conv1.weight`) and become the graph's. The heads of the coarser scales are
/// dropped.
///
/// # Errors
/// [`NetworkError::Config`] for a network that cannot be built; [`NetworkError::MissingTensor`], [`NetworkError::TensorShape`] or
/// [`NetworkError::UnexpectedTensor`] if the weights belong to another network; [`NetworkError::NotFinite`] for NaN or infinite weights.
pub fn depth_graph(config: &DepthNetConfig, mut weights: Weights) -> Result<Graph, NetworkError> {
    let alone = DepthNetConfig {
        uncertainty: false,
        ..config.clone()
    };
    if config.uncertainty {
        let of_head = |name: &str| name.starts_with(UNCERTAINTY_PREFIX);
        weights.tensors.retain(|name, _| !of_head(name));
    }
    depth_graph_with_uncertainty(&alone, weights)
}

/// Like [`depth_graph`], but a network with an uncertainty head has ln b at full size as a second output.
///
/// # Errors
/// As for [`depth_graph`].
pub fn depth_graph_with_uncertainty(
    config: &DepthNetConfig,
    weights: Weights,
) -> Result<Graph, NetworkError> {
    config.validate()?;
    let normalisation = config.encoder.normalisation;
    let mut builder = Builder {
        graph: Graph::new(normalisation.mean(), normalisation.std()),
        weights,
        repeated: BTreeMap::new(),
    };
    let outputs = if let Some(lite_mono) = &config.lite_mono {
        builder.lite_mono(lite_mono, config.uncertainty)?
    } else if let Some(r_msfm) = &config.r_msfm {
        vec![builder.r_msfm(config, r_msfm)?]
    } else if let Some(disp_net) = &config.disp_net {
        builder.disp_net(config, disp_net)?
    } else {
        let features = builder.encoder(&config.encoder)?;
        let features = builder.skips(config, features)?;
        builder.decoder(config, features)?
    };
    for output in outputs {
        builder.graph.add_output(output);
    }
    builder.nothing_left()?;
    Ok(builder.graph)
}

struct Builder {
    graph: Graph,
    /// Weights that no operation has taken yet.
    weights: Weights,
    /// Copies of weights of layers that run several times.
    repeated: BTreeMap<String, Vec<f32>>,
}

/// What is added to a convolution's sum.
enum Offset {
    /// The convolution's own bias.
    Bias,
    /// The offset of the batch normalisation with this name.
    Norm(String),
    /// Nothing.
    None,
}

/// A convolution without its weights.
struct Layer<'a> {
    /// Name that the convolution's tensors begin with.
    name: String,
    /// What is added to its sum.
    offset: Offset,
    input: ValueId,
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    dilation: usize,
    border: Border,
    residual: Option<ValueId>,
    activation: &'a Activation,
}

impl Builder {
    fn conv(&mut self, layer: &Layer) -> Result<ValueId, NetworkError> {
        let [channels_in, channels_out] = layer.channels;
        let shape = [channels_out, channels_in, layer.kernel, layer.kernel];
        let (weight, bias) = self.folded(layer, shape)?;
        self.conv_with(layer, weight, bias)
    }

    /// The layer's weights and bias, with its batch normalisation folded in.
    fn folded(
        &mut self,
        layer: &Layer,
        shape: [usize; 4],
    ) -> Result<(Vec<f32>, Vec<f32>), NetworkError> {
        let channels_out = shape[0];
        let mut weight = self.take(&format!("{}.weight", layer.name), &shape)?;
        let bias = match &layer.offset {
            Offset::Bias => self.take(&format!("{}.bias", layer.name), &[channels_out])?,
            Offset::Norm(norm) => self.fold(norm, &mut weight, channels_out)?,
            Offset::None => vec![0.0; channels_out],
        };
        Ok((weight, bias))
    }

    /// Adds the layer with the given weights.
    fn conv_with(
        &mut self,
        layer: &Layer,
        weight: Vec<f32>,
        bias: Vec<f32>,
    ) -> Result<ValueId, NetworkError> {
        let [channels_in, channels_out] = layer.channels;
        let conv = Conv {
            input: layer.input,
            weight,
            bias,
            channels_in,
            channels_out,
            kernel: layer.kernel,
            stride: layer.stride,
            dilation: layer.dilation,
            border: layer.border,
            residual: layer.residual,
            activation: *layer.activation,
        };
        self.push(layer.name.clone(), Op::Conv(Box::new(conv)))
    }

    /// γ (w ⋆ x − μ) / √(σ² + ε) + β = (s·w) ⋆ x + (β − s·μ), s = γ / √(σ² + ε). Scales the weights by s and returns the bias.
    fn fold(
        &mut self,
        norm: &str,
        weight: &mut [f32],
        channels: usize,
    ) -> Result<Vec<f32>, NetworkError> {
        let mut of = |part: &str| self.take(&format!("{norm}.{part}"), &[channels]);
        let (gamma, beta) = (of("weight")?, of("bias")?);
        let (mean, variance) = (of("running_mean")?, of("running_var")?);
        let taps = weight.len() / channels;
        let mut bias = Vec::with_capacity(channels);
        for (c, row) in weight.chunks_exact_mut(taps).enumerate() {
            let deviation = (f64::from(variance[c]) + BATCH_NORM_EPSILON).sqrt();
            let scale = f64::from(gamma[c]) / deviation;
            for w in row {
                *w = (f64::from(*w) * scale) as f32;
            }
            bias.push((f64::from(beta[c]) - scale * f64::from(mean[c])) as f32);
        }
        Ok(bias)
    }

    /// Moves a tensor's values out of the weights, so that a large network is in memory only once.
    fn take(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
        let tensor = self.weights.tensors.remove(name);
        let tensor = tensor.ok_or_else(|| NetworkError::MissingTensor {
            origin: self.weights.origin.clone(),
            name: name.into(),
            expected: shape.to_vec(),
            others: 0,
        })?;
        if tensor.shape != shape {
            return Err(NetworkError::TensorShape {
                origin: self.weights.origin.clone(),
                name: name.into(),
                expected: shape.to_vec(),
                found: tensor.shape,
                others: 0,
            });
        }
        let count = tensor.values.iter().filter(|v| !v.is_finite()).count();
        if count > 0 {
            return Err(NetworkError::NotFinite {
                origin: self.weights.origin.clone(),
                name: name.into(),
                count,
            });
        }
        Ok(tensor.values)
    }

    /// Checks that every tensor was used, except for the heads of the coarser scales, which only training needs.
    fn nothing_left(&self) -> Result<(), NetworkError> {
        let head = |name: &str| {
            ["1", "2", "3"]
                .map(|s| format!("decoder.heads.{s}."))
                .iter()
                .any(|h| name.trim_start_matches("lite_mono.").starts_with(h))
        };
        let mut left = self.weights.tensors.iter().filter(|(name, _)| !head(name));
        match left.next() {
            None => Ok(()),
            Some((name, tensor)) => Err(NetworkError::UnexpectedTensor {
                origin: self.weights.origin.clone(),
                name: name.clone(),
                found: tensor.shape.clone(),
                others: left.count(),
            }),
        }
    }

    fn push(&mut self, name: String, op: Op) -> Result<ValueId, NetworkError> {
        Ok(self.graph.push(name, op)?)
    }
}
