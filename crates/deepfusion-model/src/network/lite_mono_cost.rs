//! The cost of Lite-Mono's parts.

use super::cost::{ConvTail, ModuleCost};
use super::{InputSize, LiteMonoConfig, POSITION_CHANNELS};

impl LiteMonoConfig {
    /// The network's parts in the order in which they run. All three heads count their parameters, but only the finest counts
    /// multiply-adds: the others run in training only.
    pub(super) fn costs(&self, size: InputSize) -> Vec<ModuleCost> {
        let pixels = |halvings: usize| (size.width >> halvings) * (size.height >> halvings);
        let mut costs = Vec::new();
        let [first, ..] = self.widths;
        let mut stem = ModuleCost::new("lite_mono.encoder.stem");
        stem.conv([3, first], 3, pixels(1), ConvTail::Norm);
        stem.conv([first, first], 3, pixels(1), ConvTail::Norm);
        stem.conv([first, first], 3, pixels(1), ConvTail::Norm);
        costs.push(stem);
        let mut from = first + 3;
        for (stage, width) in self.widths.into_iter().enumerate() {
            // The image pooled for this stage.
            let mut small = ModuleCost::new(format!("lite_mono.encoder.pool.{stage}"));
            small.depthwise(3, 3, pixels(stage + 1), ConvTail::Fixed);
            costs.push(small);
            let area = pixels(stage + 2);
            let mut reduce = ModuleCost::new(format!("lite_mono.encoder.reduce.{stage}"));
            reduce.conv([from, width], 3, area, ConvTail::Nothing);
            costs.push(reduce);
            costs.push(self.dilated_cost(stage, area));
            costs.push(self.global_cost(stage, area));
            from = 2 * width + 3;
        }
        self.decoder_costs(pixels, &mut costs);
        costs
    }

    fn dilated_cost(&self, stage: usize, area: usize) -> ModuleCost {
        let width = self.widths[stage];
        let mut cost = ModuleCost::new(format!("lite_mono.encoder.stages.{stage}.dilated"));
        for _ in &self.dilations[stage] {
            cost.depthwise(width, 3, area, ConvTail::Norm);
            self.bottleneck(width, area, &mut cost);
        }
        cost
    }

    fn global_cost(&self, stage: usize, area: usize) -> ModuleCost {
        let width = self.widths[stage];
        let mut cost = ModuleCost::new(format!("lite_mono.encoder.stages.{stage}.global"));
        if stage == 0 {
            cost.give(2 * POSITION_CHANNELS, area);
            cost.conv([2 * POSITION_CHANNELS, width], 1, area, ConvTail::Bias);
        }
        // Normalisation and its factors, one temperature per head, the attention's scales.
        cost.give(width, area);
        cost.parameters += (3 * width + self.heads) as u64;
        cost.conv([width, 3 * width], 1, area, ConvTail::Bias);
        cost.multiply_adds += (2 * width * (width / self.heads) * area) as u64;
        cost.give(width, area);
        cost.conv([width, width], 1, area, ConvTail::Bias);
        cost.give(width, area);
        cost.parameters += 2 * width as u64;
        self.bottleneck(width, area, &mut cost);
        cost
    }

    /// Two 1×1 convolutions and the scale of their output.
    fn bottleneck(&self, width: usize, area: usize, cost: &mut ModuleCost) {
        let inner = self.expansion * width;
        cost.conv([width, inner], 1, area, ConvTail::Bias);
        cost.conv([inner, width], 1, area, ConvTail::Bias);
        cost.parameters += width as u64;
    }

    fn decoder_costs(&self, pixels: impl Fn(usize) -> usize, costs: &mut Vec<ModuleCost>) {
        let widths = self.decoder_widths();
        let mut from = self.widths[2];
        for (index, level) in (0..3).rev().enumerate() {
            let width = widths[level];
            let (before, after) = (pixels(level + 2), pixels(level + 1));
            let skip = level.checked_sub(1).map_or(0, |finer| self.widths[finer]);
            let mut cost = ModuleCost::new(format!("lite_mono.decoder.stages.{index}"));
            cost.conv([from, width], 3, before, ConvTail::Bias);
            cost.give(width, after);
            cost.conv([width + skip, width], 3, after, ConvTail::Bias);
            costs.push(cost);
            from = width;
        }
        let mut heads = ModuleCost::new("lite_mono.decoder.heads");
        heads.conv([from, 1], 3, pixels(1), ConvTail::Bias);
        heads.give(1, pixels(0));
        heads.conv([1, 1], 1, pixels(0), ConvTail::Fixed);
        heads.parameters = widths.iter().map(|w| (9 * w + 1) as u64).sum();
        costs.push(heads);
    }
}
