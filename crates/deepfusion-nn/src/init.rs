use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The random number generator for new weights.
///
/// One generator is passed through a network's constructor, so that a seed determines every weight, whatever else draws random numbers in
/// the same process. Burn's own generator is global to the process, and its initialisation is lazy: the weights would depend on the order
/// of first use.
#[derive(Debug, Clone)]
pub struct WeightRng(ChaCha8Rng);

impl WeightRng {
    /// A generator whose numbers depend on `seed` alone.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self::with_stream(seed, 0)
    }

    /// As [`Self::new`], for one of several networks of a run: each `stream` has its own numbers.
    #[must_use]
    pub fn with_stream(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self(rng)
    }

    /// `count` values, uniform in [−bound, bound).
    pub fn uniform(&mut self, count: usize, bound: f32) -> Vec<f32> {
        (0..count)
            .map(|_| (2.0 * self.0.random::<f32>() - 1.0) * bound)
            .collect()
    }

    /// Xavier's weights for `pairs` pairs of an input and an output channel with `area` taps each: uniform in ±√(6 / (area·channels)),
    /// `channels` being the number of input and output channels together (Glorot and Bengio, AISTATS 2010, Eq. 16).
    pub(crate) fn xavier(&mut self, pairs: usize, area: usize, channels: usize) -> Vec<f32> {
        self.uniform(pairs * area, (6.0 / (area * channels) as f32).sqrt())
    }

    /// `count` values, normal with mean 0 and the standard deviation `std` (Box–Muller).
    pub fn normal(&mut self, count: usize, std: f32) -> Vec<f32> {
        (0..count)
            .map(|_| {
                // 1 − u lies in (0, 1]: its logarithm is finite.
                let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
                let angle = std::f64::consts::TAU * self.0.random::<f64>();
                std * (radius * angle.cos()) as f32
            })
            .collect()
    }
}

/// How the weights of a new convolution are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WeightInit {
    /// Normal with variance 2 / fan_out: torchvision's choice for ResNet.
    KaimingNormalFanOut,
    /// Uniform in ±1/√fan_in, the bias too: PyTorch's default for a convolution.
    UniformFanIn,
    /// Normal with standard deviation 0.02, the bias 0: Lite-Mono's decoder.
    Normal2Percent,
    /// Uniform in ±√(6 / (fan_in + fan_out)), the bias 0: DispNet's.
    XavierUniform,
    /// Zero, the bias too: the initial output is zero.
    Zeros,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_values_have_the_wanted_moments() {
        let values = WeightRng::new(3).normal(200_000, 0.5);
        let n = values.len() as f64;
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = values.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / n - mean * mean;
        // Standard errors: 0.5/√n = 0.0011 and 0.25·√(2/n) = 0.0008; four of each.
        assert!(mean.abs() < 0.0045, "mean {mean}");
        assert!((variance - 0.25).abs() < 0.0032, "variance {variance}");
    }

    #[test]
    fn uniform_values_fill_the_interval_and_stay_inside() {
        let values = WeightRng::new(3).uniform(10_000, 0.2);
        let (low, high) = values
            .iter()
            .fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        assert!((-0.2..-0.199).contains(&low) && (0.199..=0.2).contains(&high));
    }
}
