//! What each part of the networks costs: parameters, multiply-adds, values.

use crate::depth_net::{DepthNetConfig, InputSize};
use crate::pose_net::{PoseNetConfig, WIDTH};
use crate::resnet::ResNetConfig;

/// What a part of a network costs for one image, batch normalisation folded into the convolutions.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ModuleCost {
    /// Where its tensors' names begin: `encoder.layer1`, `hce.0`, …
    pub name: String,
    /// Numbers that are learned: weights, biases, γ and β; not the running statistics.
    pub parameters: u64,
    /// Multiplications with addition in its convolutions, zeros of a border included.
    pub multiply_adds: u64,
    /// Values that its operations give.
    pub values: u64,
}

/// What follows a convolution's sum.
#[derive(Clone, Copy)]
enum After {
    Norm,
    Bias,
    Nothing,
}

impl ModuleCost {
    fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            parameters: 0,
            multiply_adds: 0,
            values: 0,
        }
    }

    fn conv(&mut self, [from, to]: [usize; 2], kernel: usize, pixels: usize, after: After) {
        let weights = from * to * kernel * kernel;
        let more = match after {
            After::Norm => 2 * to,
            After::Bias => to,
            After::Nothing => 0,
        };
        self.parameters += (weights + more) as u64;
        self.multiply_adds += (weights * pixels) as u64;
        self.give(to, pixels);
    }

    fn give(&mut self, channels: usize, pixels: usize) {
        self.values += (channels * pixels) as u64;
    }
}

impl ResNetConfig {
    /// The stem (`conv1`, `bn1`, the pooling) and `layer1`…`layer4`, their names behind `prefix`.
    fn costs(&self, prefix: &str, size: InputSize) -> Vec<ModuleCost> {
        let channels = self.channels();
        let pixels = feature_pixels(self, size);
        let mut stem = ModuleCost::new(format!("{prefix}.stem"));
        stem.conv([3 * self.frames, channels[0]], 7, pixels[0], After::Norm);
        stem.give(channels[0], pixels[1]);
        let mut costs = vec![stem];
        let mut from = channels[0];
        let mut before = pixels[1];
        for (layer, blocks) in self.depth.blocks().into_iter().enumerate() {
            let mut cost = ModuleCost::new(format!("{prefix}.layer{}", layer + 1));
            let (width, to) = (self.base_width << layer, channels[layer + 1]);
            let after = pixels[layer + 1];
            for block in 0..blocks {
                let [stride, _] = self.steps(layer, block);
                if stride != 1 || from != to {
                    cost.conv([from, to], 1, after, After::Norm);
                }
                if self.depth.is_bottleneck() {
                    cost.conv([from, width], 1, before, After::Norm);
                    cost.conv([width, width], 3, after, After::Norm);
                    cost.conv([width, to], 1, after, After::Norm);
                } else {
                    cost.conv([from, width], 3, after, After::Norm);
                    cost.conv([width, width], 3, after, After::Norm);
                }
                (from, before) = (to, after);
            }
            costs.push(cost);
        }
        costs
    }
}

/// Pixels of the five features.
fn feature_pixels(encoder: &ResNetConfig, size: InputSize) -> [usize; 5] {
    std::array::from_fn(|level| {
        let halvings = if level == 4 && encoder.is_dilated() {
            4
        } else {
            level + 1
        };
        (size.width >> halvings) * (size.height >> halvings)
    })
}

impl DepthNetConfig {
    /// The network's parts in the order in which they run. Of the heads all four have parameters, and the finest
    /// alone has multiply-adds: the others only train.
    #[must_use]
    pub fn costs(&self, size: InputSize) -> Vec<ModuleCost> {
        let mut costs = self.encoder.costs("encoder", size);
        let (raw, refined) = (self.encoder.channels(), self.decoder_channels());
        let pixels = feature_pixels(&self.encoder, size);
        for (index, level) in (1..5).enumerate() {
            let (channels, width, pixels) = (raw[level], refined[level], pixels[level]);
            if let Some(hce) = &self.hce {
                let mut cost = ModuleCost::new(format!("hce.{index}"));
                let reduce = hce.reduce_first && !hce.rates.is_empty();
                for _ in 0..1 + usize::from(reduce) {
                    cost.conv([channels, width], 1, pixels, After::Norm);
                }
                let from = if reduce { width } else { channels };
                for _ in &hce.rates {
                    cost.conv([from, width], 3, pixels, After::Norm);
                }
                let local = (1 + hce.rates.len()) * width;
                cost.conv([local, width], 1, pixels, After::Norm);
                if hce.global_pool {
                    cost.give(channels, 1);
                    cost.conv([channels, width], 1, 1, After::Bias);
                    // The projection's share of the branch that is the same everywhere.
                    cost.conv([width, width], 1, 1, After::Nothing);
                }
                costs.push(cost);
            }
            if let Some(attention) = &self.attention {
                let mut cost = ModuleCost::new(format!("attention.{index}"));
                let hidden = attention.hidden(width);
                cost.give(width, 1);
                cost.conv([width, hidden], 1, 1, After::Nothing);
                cost.conv([hidden, width], 1, 1, After::Nothing);
                cost.give(2, pixels);
                cost.conv([2, 1], attention.kernel, pixels, After::Nothing);
                cost.give(width, pixels);
                costs.push(cost);
            }
        }
        if self.aggregation {
            let mut cost = ModuleCost::new("aggregation");
            cost.give(refined[4], 1);
            cost.conv([refined[4]; 2], 1, 1, After::Bias);
            cost.give(refined[4], pixels[4]);
            costs.push(cost);
        }
        self.decoder_costs(refined, pixels, size, &mut costs);
        costs
    }

    fn decoder_costs(
        &self,
        channels: [usize; 5],
        pixels: [usize; 5],
        size: InputSize,
        costs: &mut Vec<ModuleCost>,
    ) {
        let mut from = channels[4];
        let mut before = pixels[4];
        for (index, width) in self.decoder.widths.into_iter().enumerate() {
            let mut cost = ModuleCost::new(format!("decoder.stages.{index}"));
            let (skip, after) = match 3_usize.checked_sub(index) {
                Some(level) => (channels[level], pixels[level]),
                None => (0, size.width * size.height),
            };
            cost.conv([from, width], 3, before, After::Bias);
            if after != before {
                cost.give(width, after);
            }
            cost.conv([width + skip, width], 3, after, After::Bias);
            (from, before) = (width, after);
            costs.push(cost);
        }
        let mut heads = ModuleCost::new("decoder.heads");
        heads.conv([from, 1], 3, before, After::Bias);
        heads.parameters = self.decoder.widths[1..]
            .iter()
            .map(|w| (9 * w + 1) as u64)
            .sum();
        costs.push(heads);
        if self.uncertainty {
            let mut cost = ModuleCost::new("uncertainty");
            cost.conv([from, 1], 3, before, After::Bias);
            costs.push(cost);
        }
    }
}

impl PoseNetConfig {
    /// The whole network, on one pair of frames.
    #[must_use]
    pub fn cost(&self, size: InputSize) -> ModuleCost {
        let mut all = ModuleCost::new("pose_net");
        for part in self.encoder.costs("encoder", size) {
            all.parameters += part.parameters;
            all.multiply_adds += part.multiply_adds;
            all.values += part.values;
        }
        let pixels = feature_pixels(&self.encoder, size)[4];
        let width = WIDTH;
        all.conv([self.encoder.channels()[4], width], 1, pixels, After::Bias);
        all.conv([width; 2], 3, pixels, After::Bias);
        all.conv([width; 2], 3, pixels, After::Bias);
        all.conv([width, 6 * self.poses], 1, pixels, After::Bias);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::{Weights, collect};
    use crate::{HceConfig, ResNetDepth, depth_graph};
    use burn::tensor::Device;
    use deepfusion_infer::Op;

    const SIZE: InputSize = InputSize {
        width: 192,
        height: 96,
    };

    fn learned(weights: &Weights, prefix: &str) -> u64 {
        let tensors = weights.tensors.iter();
        let counted =
            tensors.filter(|(name, _)| name.starts_with(prefix) && !name.contains(".running_"));
        counted.map(|(_, tensor)| tensor.values.len() as u64).sum()
    }

    fn check(config: &DepthNetConfig) {
        let weights = collect(&config.init(&Device::flex()).unwrap());
        let graph = depth_graph(config, weights.clone()).unwrap();
        let products = graph.multiply_adds(SIZE.width, SIZE.height);
        let values = |index: usize, op: &Op| {
            let shape = graph.shape(deepfusion_infer::ValueId(index + 1));
            let (w, h) = shape.size(SIZE.width, SIZE.height);
            let channels = match op {
                // Its parts lie there already.
                Op::Concat { .. } => 0,
                Op::UpsampleConcat { input, .. } => graph.shape(*input).channels,
                _ => shape.channels,
            };
            (channels * w * h) as u64
        };
        let costs = config.costs(SIZE);
        for cost in &costs {
            let stem = ["encoder.conv1", "encoder.bn1", "encoder.maxpool"];
            let prefixes: Vec<String> = match cost.name.as_str() {
                "encoder.stem" => stem.map(str::to_owned).to_vec(),
                name => vec![format!("{name}.")],
            };
            let parameters: u64 = prefixes.iter().map(|p| learned(&weights, p)).sum();
            assert_eq!(cost.parameters, parameters, "{}", cost.name);
            let (mut multiply_adds, mut given) = (0, 0);
            for (i, node) in graph.nodes().iter().enumerate() {
                if prefixes.iter().any(|p| node.name.starts_with(p)) {
                    multiply_adds += products[i];
                    given += values(i, &node.op);
                }
            }
            assert_eq!(cost.multiply_adds, multiply_adds, "{}", cost.name);
            assert_eq!(cost.values, given, "{}", cost.name);
        }
        let all = |of: fn(&ModuleCost) -> u64| costs.iter().map(of).sum::<u64>();
        assert_eq!(all(|c| c.parameters), learned(&weights, ""));
        assert_eq!(all(|c| c.multiply_adds), products.iter().sum::<u64>());
    }

    #[test]
    fn costs_are_those_of_the_graph_and_the_weights() {
        let mut config = DepthNetConfig::paper();
        config.encoder.base_width = 8;
        check(&config);
        let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
        config.encoder.base_width = 8;
        check(&config);
        config.hce = Some(HceConfig {
            reduce_first: false,
            global_pool: false,
            ..HceConfig::default()
        });
        check(&config);
    }

    #[test]
    fn the_pose_networks_parameters_are_its_weights() {
        let mut config = PoseNetConfig::new(ResNetDepth::ResNet50);
        config.encoder.base_width = 8;
        let weights = collect(&config.init(&Device::flex()).unwrap());
        assert_eq!(config.cost(SIZE).parameters, learned(&weights, ""));
    }
}
