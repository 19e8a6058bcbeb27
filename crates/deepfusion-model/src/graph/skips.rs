//! Context, attention and aggregation: what is between the encoder's features and the decoder.

use deepfusion_infer::{Activation, Border, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{AttentionConfig, AttentionForm, DepthNetConfig, HceConfig, NetworkError};

/// A 1×1 convolution of a value.
fn point(name: String, offset: Offset, input: ValueId, channels: [usize; 2]) -> Layer<'static> {
    Layer {
        name,
        offset,
        input,
        channels,
        kernel: 1,
        stride: 1,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: &Activation::Relu,
    }
}

/// A 1×1 convolution with batch normalisation and ReLU, with tensors named as by [`crate::layers::ConvNorm`].
fn point_norm(path: &str, input: ValueId, channels: [usize; 2]) -> Layer<'static> {
    let norm = Offset::Norm(format!("{path}.bn"));
    point(format!("{path}.conv"), norm, input, channels)
}

impl Builder {
    pub(super) fn skips(
        &mut self,
        config: &DepthNetConfig,
        mut features: [ValueId; 5],
    ) -> Result<[ValueId; 5], NetworkError> {
        for (index, feature) in features[1..].iter_mut().enumerate() {
            if let Some(hce) = &config.hce {
                *feature = self.context(hce, &format!("hce.{index}"), *feature)?;
            }
            if let Some(attention) = &config.attention {
                *feature = self.attention(attention, &format!("attention.{index}"), *feature)?;
            }
        }
        if config.aggregation {
            features[4] = self.aggregation(features[4])?;
        }
        Ok(features)
    }

    /// P([B; g]) = P_B·B + P_g·g: the global branch g is the same at every pixel, so its share of the projection
    /// is computed once and added everywhere.
    fn context(
        &mut self,
        hce: &HceConfig,
        path: &str,
        x: ValueId,
    ) -> Result<ValueId, NetworkError> {
        let channels = self.graph.shape(x).channels;
        let width = hce.width(channels);
        let to_branch = [channels, width];
        let mut branches = vec![self.conv(&point_norm(&format!("{path}.point"), x, to_branch))?];
        let reduced = if hce.reduce_first && !hce.rates.is_empty() {
            self.conv(&point_norm(&format!("{path}.reduce"), x, to_branch))?
        } else {
            x
        };
        for (index, rate) in hce.rates.iter().enumerate() {
            let channels = [self.graph.shape(reduced).channels, width];
            branches.push(self.conv(&Layer {
                kernel: 3,
                dilation: *rate,
                ..point_norm(&format!("{path}.dilated.{index}"), reduced, channels)
            })?);
        }
        let local = branches.len() * width;
        let joined = self.push(format!("{path}.concat"), Op::Concat { inputs: branches })?;
        let project = point_norm(&format!("{path}.project"), joined, [local, width]);
        if !hce.global_pool {
            return self.conv(&project);
        }
        let mean = self.push(format!("{path}.mean"), Op::GlobalMean { input: x })?;
        let name = format!("{path}.global");
        let global = self.conv(&point(name, Offset::Bias, mean, to_branch))?;

        // The projection's weights: the last `width` of each row belong to the global branch.
        let all = local + width;
        let (weight, bias) = self.folded(&project, [width, all, 1, 1])?;
        let split = |columns: std::ops::Range<usize>| -> Vec<f32> {
            let rows = weight.chunks_exact(all);
            rows.flat_map(|row| &row[columns.clone()])
                .copied()
                .collect()
        };
        let everywhere = Layer {
            name: format!("{path}.project.global"),
            activation: &Activation::Identity,
            ..point(String::new(), Offset::None, global, [width, width])
        };
        let none = vec![0.0; width];
        let everywhere = self.conv_with(&everywhere, split(local..all), none)?;
        let project = Layer {
            residual: Some(everywhere),
            ..project
        };
        self.conv_with(&project, split(0..local), bias)
    }

    fn attention(
        &mut self,
        attention: &AttentionConfig,
        path: &str,
        x: ValueId,
    ) -> Result<ValueId, NetworkError> {
        let channels = self.graph.shape(x).channels;
        let hidden = attention.hidden(channels);
        let mean = self.push(format!("{path}.mean"), Op::GlobalMean { input: x })?;
        let squeeze = format!("{path}.squeeze");
        let squeezed = self.conv(&point(squeeze, Offset::None, mean, [channels, hidden]))?;
        let excite = format!("{path}.excite");
        let channel = self.conv(&Layer {
            activation: &Activation::Sigmoid,
            ..point(excite, Offset::None, squeezed, [hidden, channels])
        })?;
        let extent = self.push(format!("{path}.extent"), Op::ChannelExtent { input: x })?;
        let spatial = self.conv(&Layer {
            kernel: attention.kernel,
            activation: &Activation::Sigmoid,
            ..point(format!("{path}.spatial"), Offset::None, extent, [2, 1])
        })?;
        let gate = Op::Gate {
            input: x,
            spatial,
            channel,
            residual: attention.form == AttentionForm::Residual,
        };
        self.push(format!("{path}.gate"), gate)
    }

    fn aggregation(&mut self, x: ValueId) -> Result<ValueId, NetworkError> {
        let channels = self.graph.shape(x).channels;
        let mean = self.push("aggregation.mean".into(), Op::GlobalMean { input: x })?;
        let name = "aggregation.project".into();
        let pixel = self.conv(&Layer {
            activation: &Activation::Identity,
            ..point(name, Offset::Bias, mean, [channels, channels])
        })?;
        self.push("aggregation.add".into(), Op::AddPixel { input: x, pixel })
    }
}
