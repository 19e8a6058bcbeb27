//! The cost of each part of the networks: parameters, multiply-adds, output values.

use super::{
    DISP_NET_LEVELS, DepthNetConfig, EXPLAINABILITY_WIDTHS, InputSize, POSE_WIDTH, PoseNetConfig,
    ResNetConfig,
};

/// Cost of a part of a network for one image, with batch normalisation folded into the convolutions.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ModuleCost {
    /// The beginning of its tensors' names: `encoder.layer1`, `hce.0`, …
    pub name: String,
    /// Number of learned parameters: weights, biases, γ and β, but not the running statistics.
    pub parameters: u64,
    /// Multiply-adds of its convolutions, including those with padding.
    pub multiply_adds: u64,
    /// Number of values that its operations output.
    pub values: u64,
}

/// What follows a convolution's sum.
#[derive(Clone, Copy)]
pub(super) enum ConvTail {
    Norm,
    Bias,
    Nothing,
    /// Nothing, and the weights are constants.
    Fixed,
}

impl ModuleCost {
    /// The sum of several parts.
    #[must_use]
    pub fn sum(name: impl Into<String>, parts: &[Self]) -> Self {
        let sum = |of: fn(&Self) -> u64| parts.iter().map(of).sum::<u64>();
        Self {
            name: name.into(),
            parameters: sum(|part| part.parameters),
            multiply_adds: sum(|part| part.multiply_adds),
            values: sum(|part| part.values),
        }
    }

    /// Its parameters in f32, in MB of 2²⁰ bytes.
    #[must_use]
    pub fn weights_mb(&self) -> f64 {
        megabytes(self.parameters)
    }

    /// Size of its operations' outputs for one image in f32, in MB of 2²⁰ bytes.
    #[must_use]
    pub fn values_mb(&self) -> f64 {
        megabytes(self.values)
    }

    pub(super) fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            parameters: 0,
            multiply_adds: 0,
            values: 0,
        }
    }

    pub(super) fn conv(
        &mut self,
        [from, to]: [usize; 2],
        kernel: usize,
        pixels: usize,
        after: ConvTail,
    ) {
        self.products(from * to * kernel * kernel, to, pixels, after);
    }

    /// One kernel for each channel (depthwise).
    pub(super) fn depthwise(
        &mut self,
        channels: usize,
        kernel: usize,
        pixels: usize,
        after: ConvTail,
    ) {
        self.products(channels * kernel * kernel, channels, pixels, after);
    }

    pub(super) fn products(&mut self, weights: usize, to: usize, pixels: usize, after: ConvTail) {
        let learned = match after {
            ConvTail::Norm => weights + 2 * to,
            ConvTail::Bias => weights + to,
            ConvTail::Nothing => weights,
            ConvTail::Fixed => 0,
        };
        self.parameters += learned as u64;
        self.multiply_adds += (weights * pixels) as u64;
        self.give(to, pixels);
    }

    pub(super) fn give(&mut self, channels: usize, pixels: usize) {
        self.values += (channels * pixels) as u64;
    }
}

/// Size of `count` f32 values in MB of 2²⁰ bytes.
fn megabytes(numbers: u64) -> f64 {
    numbers as f64 * 4.0 / (1024.0 * 1024.0)
}

impl ResNetConfig {
    /// The stem (`conv1`, `bn1`, the pooling) and `layer1`…`layer4`; their names begin with `prefix`.
    pub(super) fn costs(&self, prefix: &str, size: InputSize) -> Vec<ModuleCost> {
        let channels = self.channels();
        let pixels = feature_pixels(self, size);
        let mut stem = ModuleCost::new(format!("{prefix}.stem"));
        stem.conv([3 * self.frames, channels[0]], 7, pixels[0], ConvTail::Norm);
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
                    cost.conv([from, to], 1, after, ConvTail::Norm);
                }
                if self.depth.is_bottleneck() {
                    cost.conv([from, width], 1, before, ConvTail::Norm);
                    cost.conv([width, width], 3, after, ConvTail::Norm);
                    cost.conv([width, to], 1, after, ConvTail::Norm);
                } else {
                    cost.conv([from, width], 3, after, ConvTail::Norm);
                    cost.conv([width, width], 3, after, ConvTail::Norm);
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
    /// The network's parts in the order in which they run. All heads count their parameters, but only the finest counts multiply-adds: the
    /// others run in training only. The parameters of a part that runs several times count once.
    #[must_use]
    pub fn costs(&self, size: InputSize) -> Vec<ModuleCost> {
        if let Some(r_msfm) = &self.r_msfm {
            return r_msfm.costs(&self.encoder, size);
        }
        if let Some(disp_net) = &self.disp_net {
            let mut costs = disp_net.costs(size);
            if self.uncertainty {
                let finest = disp_net.decoder_widths()[DISP_NET_LEVELS - 1];
                let mut cost = ModuleCost::new("uncertainty");
                cost.conv([finest, 1], 3, size.width * size.height, ConvTail::Bias);
                costs.push(cost);
            }
            return costs;
        }
        if let Some(lite_mono) = &self.lite_mono {
            let mut costs = lite_mono.costs(size);
            if self.uncertainty {
                let [finest, ..] = lite_mono.decoder_widths();
                let mut cost = ModuleCost::new("uncertainty");
                let half = (size.width >> 1) * (size.height >> 1);
                cost.conv([finest, 1], 3, half, ConvTail::Bias);
                cost.give(1, size.width * size.height);
                costs.push(cost);
            }
            return costs;
        }
        let mut costs = self.encoder.costs("encoder", size);
        let (raw, refined) = (self.encoder.channels(), self.decoder_channels());
        let pixels = feature_pixels(&self.encoder, size);
        for (index, level) in (1..5).enumerate() {
            let (channels, width, pixels) = (raw[level], refined[level], pixels[level]);
            if let Some(hce) = &self.hce {
                let mut cost = ModuleCost::new(format!("hce.{index}"));
                let reduce = hce.reduce_first && !hce.rates.is_empty();
                for _ in 0..1 + usize::from(reduce) {
                    cost.conv([channels, width], 1, pixels, ConvTail::Norm);
                }
                let from = if reduce { width } else { channels };
                for _ in &hce.rates {
                    cost.conv([from, width], 3, pixels, ConvTail::Norm);
                }
                let local = (1 + hce.rates.len()) * width;
                cost.conv([local, width], 1, pixels, ConvTail::Norm);
                if hce.global_pool {
                    cost.give(channels, 1);
                    cost.conv([channels, width], 1, 1, ConvTail::Bias);
                    // The projection's share of the global branch, which is the same at every pixel.
                    cost.conv([width, width], 1, 1, ConvTail::Nothing);
                }
                costs.push(cost);
            }
            if let Some(attention) = &self.attention {
                let mut cost = ModuleCost::new(format!("attention.{index}"));
                let hidden = attention.hidden(width);
                cost.give(width, 1);
                cost.conv([width, hidden], 1, 1, ConvTail::Nothing);
                cost.conv([hidden, width], 1, 1, ConvTail::Nothing);
                cost.give(2, pixels);
                cost.conv([2, 1], attention.kernel, pixels, ConvTail::Nothing);
                cost.give(width, pixels);
                costs.push(cost);
            }
        }
        if self.aggregation {
            let mut cost = ModuleCost::new("aggregation");
            cost.give(refined[4], 1);
            cost.conv([refined[4]; 2], 1, 1, ConvTail::Bias);
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
            cost.conv([from, width], 3, before, ConvTail::Bias);
            if after != before {
                cost.give(width, after);
            }
            cost.conv([width + skip, width], 3, after, ConvTail::Bias);
            (from, before) = (width, after);
            costs.push(cost);
        }
        let mut heads = ModuleCost::new("decoder.heads");
        heads.conv([from, 1], 3, before, ConvTail::Bias);
        heads.parameters = self.decoder.widths[1..]
            .iter()
            .map(|w| (9 * w + 1) as u64)
            .sum();
        costs.push(heads);
        if self.uncertainty {
            let mut cost = ModuleCost::new("uncertainty");
            cost.conv([from, 1], 3, before, ConvTail::Bias);
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
        let width = POSE_WIDTH;
        all.conv(
            [self.encoder.channels()[4], width],
            1,
            pixels,
            ConvTail::Bias,
        );
        all.conv([width; 2], 3, pixels, ConvTail::Bias);
        all.conv([width; 2], 3, pixels, ConvTail::Bias);
        all.conv([width, 6 * self.poses], 1, pixels, ConvTail::Bias);
        if self.explainability {
            self.explainability_cost(size, &mut all);
        }
        all
    }

    /// Five layers with the feature enlarged between them, and the masks of both frames.
    fn explainability_cost(&self, size: InputSize, all: &mut ModuleCost) {
        let mut from = self.encoder.channels()[4];
        for (index, width) in EXPLAINABILITY_WIDTHS.into_iter().enumerate() {
            let pixels = (size.width >> (5 - index)) * (size.height >> (5 - index));
            if index > 0 {
                all.give(from, pixels);
            }
            all.conv([from, width], 3, pixels, ConvTail::Bias);
            from = width;
        }
        all.conv(
            [from, 2],
            3,
            (size.width >> 1) * (size.height >> 1),
            ConvTail::Bias,
        );
        all.give(2, size.width * size.height);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_have_a_size_in_memory() {
        let part = |name: &str, parameters, values| ModuleCost {
            name: name.into(),
            parameters,
            multiply_adds: 10 * parameters,
            values,
        };
        let parts = [part("a", 1 << 18, 1 << 20), part("b", 1 << 19, 0)];
        let whole = ModuleCost::sum("both", &parts);
        assert_eq!(whole.name, "both");
        assert_eq!(whole.parameters, (1 << 18) + (1 << 19));
        assert_eq!(whole.multiply_adds, 10 * whole.parameters);
        assert_eq!((whole.weights_mb(), whole.values_mb()), (3.0, 4.0));
    }
}
