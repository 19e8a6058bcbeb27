//! The cost of DispNet: [`super::ModuleCost`]s of its parts.

use super::cost::ConvTail;
use super::{DISP_NET_KERNELS, DISP_NET_LEVELS, DispNetConfig, InputSize, ModuleCost};

impl DispNetConfig {
    /// The network's parts in the order in which they run. All four heads run in prediction, as each scale reads the previous one's
    /// disparity.
    pub(super) fn costs(&self, size: InputSize) -> Vec<ModuleCost> {
        let mut costs = Vec::new();
        let mut from = 3;
        for (level, (width, kernel)) in self.widths().into_iter().zip(DISP_NET_KERNELS).enumerate()
        {
            let pixels = Self::pixels(size, level + 1);
            let mut cost = ModuleCost::new(format!("disp_net.encoder.{level}"));
            cost.conv([from, width], kernel, pixels, ConvTail::Bias);
            cost.conv([width; 2], kernel, pixels, ConvTail::Bias);
            costs.push(cost);
            from = width;
        }
        let mut heads = ModuleCost::new("disp_net.heads");
        for (stage, width) in self.decoder_widths().into_iter().enumerate() {
            let halvings = DISP_NET_LEVELS - 1 - stage;
            let pixels = Self::pixels(size, halvings);
            let mut cost = ModuleCost::new(format!("disp_net.decoder.{stage}"));
            // All taps are applied at each pixel of the small image.
            cost.conv(
                [self.before(stage), width],
                3,
                Self::pixels(size, halvings + 1),
                ConvTail::Bias,
            );
            cost.give(3 * width, Self::pixels(size, halvings + 1));
            let coarse = usize::from(Self::reads_disparity(stage));
            cost.give(coarse, pixels);
            let joined = width + self.skip(stage) + coarse;
            cost.conv([joined, width], 3, pixels, ConvTail::Bias);
            costs.push(cost);
            if Self::scale_of(stage).is_some() {
                heads.conv([width, 1], 3, pixels, ConvTail::Bias);
            }
        }
        costs.push(heads);
        costs
    }
}
