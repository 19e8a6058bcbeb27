//! The encoder's part of the graph.

use deepfusion_infer::{Activation, Border, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{NetworkError, ResNetConfig};

impl Builder {
    pub(super) fn encoder(&mut self, encoder: &ResNetConfig) -> Result<[ValueId; 5], NetworkError> {
        self.encoder_to("encoder", encoder, 4)
    }

    /// The features of the stem and the first `layers` layers. The other entries repeat the last of them. Names begin with `prefix`.
    pub(super) fn encoder_to(
        &mut self,
        prefix: &str,
        encoder: &ResNetConfig,
        layers: usize,
    ) -> Result<[ValueId; 5], NetworkError> {
        let width = encoder.base_width;
        let expansion = encoder.depth.expansion();
        let f0 = self.conv(&Layer {
            name: format!("{prefix}.conv1"),
            offset: Offset::Norm(format!("{prefix}.bn1")),
            input: ValueId::IMAGE,
            channels: [3, width],
            kernel: 7,
            stride: 2,
            dilation: 1,
            border: Border::Zero,
            residual: None,
            activation: &Activation::Relu,
        })?;
        let mut features = [f0; 5];
        let mut x = self.push(format!("{prefix}.maxpool"), Op::MaxPool { input: f0 })?;
        let mut channels = width;
        for (index, blocks) in encoder.depth.blocks().into_iter().take(layers).enumerate() {
            let inner = width << index;
            for block in 0..blocks {
                let steps = encoder.steps(index, block);
                let path = format!("{prefix}.layer{}.{block}", index + 1);
                let outer = inner * expansion;
                x = self.block(&path, x, [channels, inner, outer], steps)?;
                channels = outer;
            }
            features[index + 1..].fill(x);
        }
        Ok(features)
    }

    /// relu(residual(x) + shortcut(x)); a basic block if `inner` equals `outer`, else a bottleneck.
    fn block(
        &mut self,
        path: &str,
        x: ValueId,
        [channels, inner, outer]: [usize; 3],
        [stride, dilation]: [usize; 2],
    ) -> Result<ValueId, NetworkError> {
        let layer = |conv: &str, norm: &str, input, channels, kernel, stride| Layer {
            name: format!("{path}.{conv}"),
            offset: Offset::Norm(format!("{path}.{norm}")),
            input,
            channels,
            kernel,
            stride,
            dilation: if kernel > 1 { dilation } else { 1 },
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
}
