//! The cost of R-MSFM: [`super::ModuleCost`]s of its parts.

use super::cost::ConvTail;
use super::{InputSize, ModuleCost, R_MSFM_STATE, RMsfmConfig, ResNetConfig};

impl RMsfmConfig {
    /// The network's parts in the order in which they first run. The refining network runs once per iteration, but its parameters count
    /// once. Its weights for the enlargement are needed in the last iteration only.
    pub(super) fn costs(&self, encoder: &ResNetConfig, size: InputSize) -> Vec<ModuleCost> {
        let mut costs = encoder.costs("r_msfm.encoder", size);
        costs.truncate(3);
        let [f0, f1, f2, ..] = encoder.channels();
        let (state, pixels) = (R_MSFM_STATE, Self::pixels(size));
        let quarter = (size.width >> 2) * (size.height >> 2);
        let mut features = ModuleCost::new("r_msfm.features");
        features.conv([f2, state], 3, pixels, ConvTail::Bias);
        features.conv([f1, state], 3, pixels, ConvTail::Bias);
        features.conv([f0, 96], 3, quarter, ConvTail::Bias);
        features.conv([96, state], 3, pixels, ConvTail::Bias);
        if self.twice() {
            for _ in 0..6 {
                features.strip([state; 2], pixels);
            }
        }
        costs.push(features);
        let mut gru = ModuleCost::new("r_msfm.gru");
        for _ in 0..6 {
            gru.strip([2 * state, state], pixels);
        }
        gru.repeated(self.iterations - 1);
        costs.push(gru);
        let mut update = ModuleCost::new("r_msfm.update");
        let layers = [
            (state, 160, 3),
            (160, 128, 3),
            (1, 64, 7),
            (64, 32, 3),
            (160, 191, 3),
            (192, 256, 3),
            (256, 1, 3),
        ];
        for (from, to, kernel) in layers {
            update.conv([from, to], kernel, pixels, ConvTail::Bias);
        }
        update.repeated(self.iterations);
        costs.push(update);
        let mut weights = ModuleCost::new("r_msfm.weights");
        weights.conv([192, 324], 3, pixels, ConvTail::Bias);
        weights.conv([324, 576], 1, pixels, ConvTail::Bias);
        weights.give(1, size.width * size.height);
        costs.push(weights);
        costs
    }
}

impl ModuleCost {
    /// A 1×3 or 3×1 convolution.
    fn strip(&mut self, [from, to]: [usize; 2], pixels: usize) {
        self.products(3 * from * to, to, pixels, ConvTail::Bias);
    }

    /// The cost of a part that runs several times.
    fn repeated(&mut self, times: usize) {
        self.multiply_adds *= times as u64;
        self.values *= times as u64;
    }
}
