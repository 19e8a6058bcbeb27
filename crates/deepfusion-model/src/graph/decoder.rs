//! The decoder's part of the graph.

use deepfusion_infer::{Activation, Border, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{DepthNetConfig, NetworkError};

impl Builder {
    pub(super) fn decoder(
        &mut self,
        config: &DepthNetConfig,
        [f0, f1, f2, f3, f4]: [ValueId; 5],
    ) -> Result<Vec<ValueId>, NetworkError> {
        let layer = |name: String, input, channels, activation| Layer {
            name,
            offset: Offset::Bias,
            input,
            channels,
            kernel: 3,
            stride: 1,
            dilation: 1,
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
            let joined = match skip {
                Some(skip) if index == 0 && config.encoder.is_dilated() => Op::Concat {
                    inputs: vec![x, skip],
                },
                skip => Op::UpsampleConcat { input: x, skip },
            };
            x = self.push(format!("{path}.concat"), joined)?;
            let channels = [self.graph.shape(x).channels, width];
            x = self.conv(&layer(
                format!("{path}.fuse"),
                x,
                channels,
                &Activation::Elu,
            ))?;
        }
        let channels = [config.decoder.widths[4], 1];
        let heads = [
            ("decoder.heads.0", &Activation::Sigmoid),
            ("uncertainty", &Activation::Identity),
        ];
        let of_config = 1 + usize::from(config.uncertainty);
        heads
            .into_iter()
            .take(of_config)
            .map(|(name, activation)| self.conv(&layer(name.into(), x, channels, activation)))
            .collect()
    }
}
