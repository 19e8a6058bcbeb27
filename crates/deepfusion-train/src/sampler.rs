use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// The order of the samples: every epoch has a new permutation.
///
/// It has no state: the samples of a step depend on the seed and the step alone, so that a resumed run sees exactly the same samples as an
/// uninterrupted one.
#[derive(Debug, Clone)]
pub struct Sampler {
    samples: usize,
    batch: usize,
    seed: u64,
}

impl Sampler {
    /// A sampler of batches of `batch` from `samples` samples.
    #[must_use]
    pub fn new(samples: usize, batch: usize, seed: u64) -> Self {
        Self {
            samples,
            batch: batch.clamp(1, samples.max(1)),
            seed,
        }
    }

    /// Batches in one pass over the data. A last incomplete batch is filled from the next epoch.
    #[must_use]
    pub fn batches_per_epoch(&self) -> usize {
        self.samples.div_ceil(self.batch)
    }

    /// The samples of batch number `index`, counted from 0 over the whole run.
    #[must_use]
    pub fn batch(&self, index: usize) -> Vec<usize> {
        self.samples_at(index * self.batch..(index + 1) * self.batch)
    }

    /// The samples at these positions, counted from 0 over the whole run.
    pub(crate) fn samples_at(&self, positions: Range<usize>) -> Vec<usize> {
        let mut order: Option<(usize, Vec<usize>)> = None;
        positions
            .map(|position| {
                let epoch = position / self.samples;
                let order = match &mut order {
                    Some((of, order)) if *of == epoch => order,
                    stale => &mut stale.insert((epoch, self.permutation(epoch))).1,
                };
                order[position % self.samples]
            })
            .collect()
    }

    fn permutation(&self, epoch: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.samples).collect();
        order.shuffle(&mut stream(self.seed, 0, epoch));
        order
    }
}

/// An independent random stream for every purpose and index.
pub(crate) fn stream(seed: u64, purpose: u64, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ purpose.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    rng.set_stream(index as u64);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_has_every_sample_once() {
        let sampler = Sampler::new(10, 5, 3);
        let mut seen: Vec<usize> = (4..6).flat_map(|i| sampler.batch(i)).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..10).collect::<Vec<_>>());
    }

    #[test]
    fn epochs_differ_and_a_batch_may_span_two() {
        let sampler = Sampler::new(7, 3, 3);
        let seen: Vec<usize> = (0..7).flat_map(|i| sampler.batch(i)).collect();
        assert_ne!(seen[..7], seen[7..14]);
        for epoch in seen.chunks(7) {
            let mut epoch = epoch.to_vec();
            epoch.sort_unstable();
            assert_eq!(epoch, (0..7).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_batch_is_at_most_as_large_as_the_data() {
        assert_eq!(Sampler::new(2, 12, 0).batch(5).len(), 2);
    }
}
