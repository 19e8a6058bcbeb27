use serde::{Deserialize, Serialize};

/// The range of depths a network can express, in metres, and its map to the sigmoid output
/// (docs/concepts/network.md): d = 1/D_max + (1/D_min − 1/D_max)·σ, depth = 1/d.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DepthRange {
    /// Smallest depth, in metres.
    pub min_m: f64,
    /// Largest depth, in metres.
    pub max_m: f64,
}

impl Default for DepthRange {
    /// The paper's 0.1 m to 90 m.
    fn default() -> Self {
        Self {
            min_m: 0.1,
            max_m: 90.0,
        }
    }
}

impl DepthRange {
    /// Metric disparity (1/m) of the network's sigmoid output.
    #[must_use]
    pub fn disparity(&self, sigmoid: f64) -> f64 {
        let (low, high) = (1.0 / self.max_m, 1.0 / self.min_m);
        low + (high - low) * sigmoid
    }

    /// Depth in metres of the network's sigmoid output.
    #[must_use]
    pub fn depth_m(&self, sigmoid: f64) -> f64 {
        1.0 / self.disparity(sigmoid)
    }

    /// The sigmoid output that corresponds to `depth_m`.
    #[must_use]
    pub fn sigmoid_of(&self, depth_m: f64) -> f64 {
        let (low, high) = (1.0 / self.max_m, 1.0 / self.min_m);
        (1.0 / depth_m - low) / (high - low)
    }

    /// The bias that makes a head with zero input predict `depth_m`: the logit of [`Self::sigmoid_of`].
    #[must_use]
    pub fn logit_of(&self, depth_m: f64) -> f64 {
        let s = self.sigmoid_of(depth_m);
        (s / (1.0 - s)).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_ends_of_the_sigmoid_are_the_ends_of_the_range() {
        let range = DepthRange::default();
        assert_relative_eq!(range.depth_m(0.0), 90.0, epsilon = 1e-9);
        assert_relative_eq!(range.depth_m(1.0), 0.1, epsilon = 1e-12);
    }

    #[test]
    fn the_bias_for_ten_metres_gives_ten_metres() {
        let range = DepthRange::default();
        let sigmoid = 1.0 / (1.0 + (-range.logit_of(10.0)).exp());
        assert_relative_eq!(range.depth_m(sigmoid), 10.0, epsilon = 1e-9);
    }
}
