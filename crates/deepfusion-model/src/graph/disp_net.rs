//! DispNet's part of the graph. A transposed convolution of stride 2 is a convolution to four times its channels, which are then rearranged
//! to pixels (depth to space).

use deepfusion_infer::{Activation, Border, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{
    DISP_NET_DISPARITY, DISP_NET_KERNELS, DISP_NET_LEVELS, DepthNetConfig, DispNetConfig,
    NetworkError,
};

/// Side of the transposed convolutions' kernels.
const SIDE: usize = 3;

impl Builder {
    /// The disparity at the image's size, and ln b if the network has an uncertainty head.
    pub(super) fn disp_net(
        &mut self,
        config: &DepthNetConfig,
        disp_net: &DispNetConfig,
    ) -> Result<Vec<ValueId>, NetworkError> {
        let (mut x, mut skips) = (ValueId::IMAGE, Vec::new());
        for (level, width) in disp_net.widths().into_iter().enumerate() {
            let path = format!("disp_net.encoder.{level}");
            let kernel = DISP_NET_KERNELS[level];
            for (part, stride) in [("halve", 2), ("keep", 1)] {
                let channels = [self.graph.shape(x).channels, width];
                x = self.conv(&Layer {
                    kernel,
                    stride,
                    activation: &Activation::Relu,
                    ..layer(format!("{path}.{part}"), x, channels)
                })?;
            }
            skips.push(x);
        }
        skips.pop();
        let mut disparity = None;
        for (stage, width) in disp_net.decoder_widths().into_iter().enumerate() {
            let path = format!("disp_net.decoder.{stage}");
            let mut inputs = vec![self.transposed(&format!("{path}.enlarge"), x, width)?];
            inputs.extend(skips.pop());
            if let Some(sigmoid) = disparity {
                inputs.push(self.coarse_disparity(&path, sigmoid)?);
            }
            let joined = self.push(format!("{path}.joined"), Op::Concat { inputs })?;
            let channels = [self.graph.shape(joined).channels, width];
            x = self.conv(&Layer {
                activation: &Activation::Relu,
                ..layer(format!("{path}.join"), joined, channels)
            })?;
            if let Some(scale) = DispNetConfig::scale_of(stage) {
                disparity = Some(self.conv(&Layer {
                    activation: &Activation::Sigmoid,
                    ..layer(format!("disp_net.heads.{scale}"), x, [width, 1])
                })?);
            }
        }
        let mut outputs: Vec<ValueId> = disparity.into_iter().collect();
        if config.uncertainty {
            let width = disp_net.decoder_widths()[DISP_NET_LEVELS - 1];
            outputs.push(self.conv(&Layer {
                border: Border::Reflect,
                ..layer("uncertainty".into(), x, [width, 1])
            })?);
        }
        Ok(outputs)
    }

    /// The disparity of one scale, enlarged for the next.
    fn coarse_disparity(&mut self, path: &str, sigmoid: ValueId) -> Result<ValueId, NetworkError> {
        let [factor, summand] = DISP_NET_DISPARITY.map(|number| number as f32);
        let scaled = Layer {
            kernel: 1,
            ..layer(format!("{path}.disparity"), sigmoid, [1, 1])
        };
        let input = self.conv_with(&scaled, vec![factor], vec![summand])?;
        self.push(format!("{path}.disparity.enlarge"), Op::Enlarge { input })
    }

    /// A transposed convolution, 3×3 and stride 2, with ReLU. Along each axis out(2i) = w₁·x(i) and out(2i + 1) = w₂·x(i) + w₀·x(i + 1),
    /// with zeros beyond the edge.
    fn transposed(
        &mut self,
        name: &str,
        input: ValueId,
        width: usize,
    ) -> Result<ValueId, NetworkError> {
        let from = self.graph.shape(input).channels;
        let weight = self.take(&format!("{name}.weight"), &[from, width, SIDE, SIDE])?;
        let bias = self.take(&format!("{name}.bias"), &[width])?;
        // For an even and an odd output pixel: which tap of the transposed kernel each tap of the plain kernel is.
        let taps = [[None, Some(1), None], [None, Some(2), Some(0)]];
        let area = SIDE * SIDE;
        let mut spread = Vec::with_capacity(4 * weight.len() * area);
        for (down, across) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            for to in 0..width {
                for channel in 0..from {
                    let own = &weight[(channel * width + to) * area..][..area];
                    let tap = |row: Option<usize>, column: Option<usize>| {
                        let both = row.zip(column);
                        both.map_or(0.0, |(row, column)| own[SIDE * row + column])
                    };
                    let rows = taps[down].into_iter();
                    spread.extend(rows.flat_map(|row| taps[across].map(|column| tap(row, column))));
                }
            }
        }
        let wide = Layer {
            activation: &Activation::Relu,
            ..layer(name.into(), input, [from, 4 * width])
        };
        let input = self.conv_with(&wide, spread, bias.repeat(4))?;
        self.push(format!("{name}.pixels"), Op::DepthToSpace { input })
    }
}

/// A 3×3 convolution of stride 1, padded with zeros.
fn layer(name: String, input: ValueId, channels: [usize; 2]) -> Layer<'static> {
    Layer {
        name,
        offset: Offset::Bias,
        input,
        channels,
        kernel: 3,
        stride: 1,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: &Activation::Identity,
    }
}
