/// The median; for an even number of values the mean of the two middle ones, as in NumPy. `None` without values. NaN sorts last.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let upper = *upper;
    if below.is_empty() || values.len() % 2 == 1 {
        return Some(upper);
    }
    let lower = values[..middle].iter().copied().max_by(f64::total_cmp)?;
    Some((lower + upper) / 2.0)
}

/// The arithmetic mean; `None` without values.
pub(crate) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The standard deviation: the squared deviations are divided by the count minus `freedom`. `None` if that is not positive.
pub(crate) fn standard_deviation(values: &[f64], freedom: usize) -> Option<f64> {
    let centre = mean(values)?;
    let n = values.len().checked_sub(freedom).filter(|n| *n > 0)?;
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    Some((squares / n as f64).sqrt())
}

/// The 95 % interval of the mean by percentile bootstrap: 10,000 resamples with replacement. `None` for fewer than two values, which have
/// no spread.
pub(crate) fn bootstrap_mean_ci95(values: &[f64], seed: u64) -> Option<[f64; 2]> {
    const RESAMPLES: usize = 10_000;
    if values.len() < 2 {
        return None;
    }
    let mut random = SplitMix64(seed);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let sum: f64 = (0..values.len())
                .map(|_| values[random.below(values.len())])
                .sum();
            sum / values.len() as f64
        })
        .collect();
    means.sort_unstable_by(f64::total_cmp);
    let percentile = |p: f64| means[((RESAMPLES - 1) as f64 * p).round() as usize];
    Some([percentile(0.025), percentile(0.975)])
}

/// Vigna's SplitMix64. With our own eight lines, the sequence does not change with a dependency's version, so a report can be reproduced
/// years later.
#[derive(Debug, Clone)]
pub(crate) struct SplitMix64(pub(crate) u64);

impl SplitMix64 {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A random number in [0, `n`), n ≥ 1 (its bias, below n / 2⁶⁴, does not matter here).
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next()) * n as u128) >> 64) as usize
    }
}

/// A uniform sample of at most `capacity` items of a stream of unknown length (Vitter's algorithm R).
#[derive(Debug, Clone)]
pub(crate) struct Reservoir<T> {
    capacity: usize,
    seen: usize,
    random: SplitMix64,
    pub(crate) items: Vec<T>,
}

impl<T> Reservoir<T> {
    pub(crate) fn new(capacity: usize, seed: u64) -> Self {
        Self {
            capacity,
            seen: 0,
            random: SplitMix64(seed ^ 0x70_6f69_6e74),
            items: Vec::new(),
        }
    }

    /// Takes one more item of the stream; `make` is called only if the item is kept.
    pub(crate) fn push(&mut self, item: impl FnOnce() -> T) {
        self.seen += 1;
        if self.items.len() < self.capacity {
            self.items.push(item());
        } else if self.capacity > 0 {
            let slot = self.random.below(self.seen);
            if slot < self.capacity {
                self.items[slot] = item();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn splitmix_gives_its_published_sequence() {
        // The first outputs for seed 1234567 according to the test of Vigna's reference implementation (also on Rosetta Code).
        let mut random = SplitMix64(1_234_567);
        assert_eq!(random.next(), 6_457_827_717_110_365_317);
        assert_eq!(random.next(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn the_bootstrap_interval_has_the_width_theory_says() {
        // 400 values of known spread: the interval is ±1.96 σ/√n; the resampling noise of the percentiles is about 3 %.
        let mut random = SplitMix64(3);
        let values: Vec<f64> = (0..400)
            .map(|_| random.below(1_000_000) as f64 / 1e6)
            .collect();
        let [low, high] = bootstrap_mean_ci95(&values, 1).unwrap();
        let expected = 2.0 * 1.96 * standard_deviation(&values, 0).unwrap() / 20.0;
        assert!(
            ((high - low) / expected - 1.0).abs() < 0.06,
            "{} {expected}",
            high - low
        );
        assert_eq!(bootstrap_mean_ci95(&[1.0], 1), None);
        assert_eq!(bootstrap_mean_ci95(&values, 1), Some([low, high]), "seeded");
    }

    #[test]
    fn a_reservoir_samples_evenly() {
        let mut hits = [0usize; 20];
        for seed in 0..2000 {
            let mut reservoir = Reservoir::new(5, seed);
            (0..20).for_each(|i| reservoir.push(|| f64::from(i)));
            assert_eq!(reservoir.items.len(), 5);
            reservoir.items.iter().for_each(|i| hits[*i as usize] += 1);
        }
        // 500 of each are expected; σ ≈ 19, so ±100 is more than five sigma.
        assert!(hits.iter().all(|h| (400..600).contains(h)), "{hits:?}");
    }

    proptest! {
        #[test]
        fn the_median_is_that_of_the_sorted_values(values in prop::collection::vec(-1e3..1e3f64, 1..40)) {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            let n = sorted.len();
            let expected = if n % 2 == 1 { sorted[n / 2] } else { (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0 };
            prop_assert_eq!(median(&values), Some(expected));
        }
    }
}
