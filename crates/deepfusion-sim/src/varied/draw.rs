//! Random draws: seeds that do not depend on the order of calls, and a few distributions.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// An independent generator for each (seed, number, purpose).
pub(super) fn generator(seed: u64, number: u64, purpose: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(mix(mix(mix(seed) ^ number) ^ purpose))
}

/// SplitMix64's finaliser (Steele, Lea and Flood, 2014): neighbouring numbers become unrelated ones.
pub(super) fn mix(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A normal draw (Box–Muller), clamped to `most` standard deviations.
pub(super) fn normal(rng: &mut ChaCha8Rng, mean: f64, deviation: f64, most: f64) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    let angle = std::f64::consts::TAU * rng.random::<f64>();
    mean + deviation * (radius * angle.cos()).clamp(-most, most)
}

/// A draw that is uniform in the logarithm.
pub(super) fn log_uniform(rng: &mut ChaCha8Rng, least: f64, most: f64) -> f64 {
    (least.ln() + (most / least).ln() * rng.random::<f64>()).exp()
}

/// One of several choices, by weight.
pub(super) fn weighted<T: Copy>(rng: &mut ChaCha8Rng, choices: &[(f64, T)]) -> T {
    let total: f64 = choices.iter().map(|c| c.0).sum();
    let mut left = total * rng.random::<f64>();
    for (weight, choice) in choices {
        left -= weight;
        if left < 0.0 {
            return *choice;
        }
    }
    choices[choices.len() - 1].1
}

/// A fast stream of approximately normal numbers, for pixel noise: each is the sum of four uniform ones.
pub(super) struct FastNoise(u64);

impl FastNoise {
    /// The stream with this seed.
    pub(super) fn new(seed: u64) -> Self {
        Self(mix(seed))
    }

    /// The next number: mean 0, deviation 1, within ±3.47.
    #[inline]
    pub(super) fn next(&mut self) -> f32 {
        // A Weyl sequence through a multiply-xorshift mixer.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        z ^= z >> 32;
        let sum = (z & 0xFFFF) + ((z >> 16) & 0xFFFF) + ((z >> 32) & 0xFFFF) + (z >> 48);
        // Four uniform numbers of variance 65536²/12 each.
        (sum as f32 - 131_070.0) * (1.0 / 37_837.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_noise_has_mean_zero_and_variance_one() {
        let mut noise = FastNoise::new(3);
        let draws: Vec<f64> = (0..100_000).map(|_| f64::from(noise.next())).collect();
        let mean = draws.iter().sum::<f64>() / 1e5;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 1e5;
        assert!(
            mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03,
            "{mean} {variance}"
        );
        let lag = draws.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / 1e5;
        assert!(lag.abs() < 0.02, "{lag}");
    }

    #[test]
    fn normal_draws_are_normal_and_clamped() {
        let mut rng = generator(1, 2, 3);
        let draws: Vec<f64> = (0..20_000)
            .map(|_| normal(&mut rng, 5.0, 2.0, 1.5))
            .collect();
        let mean = draws.iter().sum::<f64>() / 2e4;
        assert!((mean - 5.0).abs() < 0.05, "{mean}");
        assert!(draws.iter().all(|x| (x - 5.0).abs() <= 3.0));
    }

    #[test]
    fn draws_follow_their_weights() {
        let mut rng = generator(1, 2, 3);
        let twos = (0..10_000)
            .filter(|_| weighted(&mut rng, &[(1.0, 1), (3.0, 2)]) == 2)
            .count();
        assert!((7300..7700).contains(&twos), "{twos}");
    }

    #[test]
    fn each_argument_changes_the_generator() {
        let first = |a, b, c| generator(a, b, c).random::<u64>();
        let all = [
            first(1, 1, 1),
            first(2, 1, 1),
            first(1, 2, 1),
            first(1, 1, 2),
            first(2, 1, 2),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|b| a != b));
        }
    }
}
