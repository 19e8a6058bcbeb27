//! Several processes that train one network together: synchronous data parallelism.
//!
//! Each worker has a copy of the networks and takes its own part of every step's samples. The gradients are averaged over the workers by a
//! library for communication (MPI, NCCL, gloo, …), behind one operation: the sum of a flat array ([`Workers::sum`]). K workers with batches
//! of B and `accumulate` = a learn the same as one worker with batches of B and `accumulate` = K·a, up to rounding.

use std::error::Error as StdError;

use deepfusion_nn::weights::Weights;

use crate::{Error, LossTerms, NamedGradients, WorkersProblem};

/// A trainer's connection to the other workers.
pub trait Workers: Send {
    /// This worker's index, from 0. Worker 0 validates, logs and writes the checkpoints.
    fn rank(&self) -> usize;

    /// Number of workers.
    fn count(&self) -> usize;

    /// Replaces the values by their sums over all workers. All workers get the same sums. They call it in the same order and with the same
    /// number of values.
    ///
    /// # Errors
    /// If the others cannot be reached. Training then ends; saved checkpoints stay.
    fn sum(&mut self, values: &mut [f32]) -> Result<(), Box<dyn StdError + Send + Sync>>;
}

/// A trainer that works alone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SingleWorker;

impl Workers for SingleWorker {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        1
    }

    fn sum(&mut self, _: &mut [f32]) -> Result<(), Box<dyn StdError + Send + Sync>> {
        Ok(())
    }
}

/// A trainer's connection to its workers, with the operations that the trainer needs.
pub(crate) struct WorkerGroup(Box<dyn Workers>);

impl WorkerGroup {
    pub(crate) fn of(workers: Box<dyn Workers>) -> Self {
        Self(workers)
    }

    pub(crate) fn rank(&self) -> usize {
        self.0.rank()
    }

    pub(crate) fn count(&self) -> usize {
        self.0.count().max(1)
    }

    pub(crate) fn leads(&self) -> bool {
        self.rank() == 0
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), Error> {
        if self.count() == 1 {
            return Ok(());
        }
        let (rank, count) = (self.rank(), self.count());
        let failed = |error| Error::Workers {
            rank,
            count,
            reason: WorkersProblem::Unreachable(error),
        };
        self.0.sum(values).map_err(failed)
    }

    /// Replaces the values by their means.
    pub(crate) fn mean(&mut self, values: &mut [f32]) -> Result<(), Error> {
        self.sum(values)?;
        let count = self.count() as f32;
        if count > 1.0 {
            values.iter_mut().for_each(|value| *value /= count);
        }
        Ok(())
    }

    /// For each flag, whether any worker has set it.
    pub(crate) fn any<const N: usize>(&mut self, flags: [bool; N]) -> Result<[bool; N], Error> {
        let mut sums = flags.map(|flag| f32::from(u8::from(flag)));
        self.sum(&mut sums)?;
        Ok(sums.map(|sum| sum > 0.0))
    }

    /// Fails if the workers' numbers (hashes) differ. Only the lowest 16 bits of each are compared, so that their sums are exact.
    pub(crate) fn check_equal(&mut self, numbers: [u64; 3]) -> Result<(), Error> {
        let own = numbers.map(|number| (number & 0xffff) as f32);
        let mut sums = own;
        self.sum(&mut sums)?;
        let count = self.count() as f32;
        let differs = own
            .iter()
            .zip(sums)
            .position(|(own, sum)| own * count != sum);
        // A worker whose number happens to be the mean of all sees no difference, but the others do.
        let [differs_here] = self.any([differs.is_some()])?;
        if !differs_here {
            return Ok(());
        }
        let reason = match differs {
            Some(0) => WorkersProblem::OtherWeights,
            Some(1) => WorkersProblem::OtherSamples,
            _ => WorkersProblem::OtherSettings,
        };
        Err(Error::Workers {
            rank: self.rank(),
            count: self.count(),
            reason,
        })
    }

    /// A network's tensors with the running statistics of its batch norms averaged over the workers.
    pub(crate) fn mean_statistics(&mut self, mut weights: Weights) -> Result<Weights, Error> {
        let is_running =
            |name: &str| name.ends_with("running_mean") || name.ends_with("running_var");
        let mut flat = Vec::new();
        for (name, tensor) in &weights.tensors {
            if is_running(name) {
                flat.extend_from_slice(&tensor.values);
            }
        }
        self.mean(&mut flat)?;
        let mut rest = flat.as_slice();
        for (name, tensor) in &mut weights.tensors {
            if is_running(name) {
                let (own, others) = rest.split_at(tensor.values.len());
                tensor.values.copy_from_slice(own);
                rest = others;
            }
        }
        Ok(weights)
    }

    /// A step's gradients and losses, averaged over the workers.
    pub(crate) fn average(
        &mut self,
        gradients: &mut NamedGradients,
        losses: &mut LossTerms,
    ) -> Result<(), Error> {
        if self.count() == 1 {
            return Ok(());
        }
        let mut flat: Vec<f32> = losses
            .named()
            .iter()
            .map(|(_, value)| *value as f32)
            .collect();
        let terms = flat.len();
        gradients.append_to(&mut flat);
        self.mean(&mut flat)?;
        gradients.take_from(&flat[terms..]);
        let mean: Vec<f64> = flat[..terms]
            .iter()
            .map(|value| f64::from(*value))
            .collect();
        losses.set_from(&mean);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A worker among others whose values the test sets.
    struct Among {
        rank: usize,
        others: Vec<f32>,
    }

    impl Workers for Among {
        fn rank(&self) -> usize {
            self.rank
        }

        fn count(&self) -> usize {
            2
        }

        fn sum(&mut self, values: &mut [f32]) -> Result<(), Box<dyn StdError + Send + Sync>> {
            if self.others.is_empty() {
                return Err("the other is gone".into());
            }
            let others = self.others.iter().cycle();
            values.iter_mut().zip(others).for_each(|(v, o)| *v += o);
            Ok(())
        }
    }

    fn among(others: &[f32]) -> WorkerGroup {
        WorkerGroup::of(Box::new(Among {
            rank: 1,
            others: others.to_vec(),
        }))
    }

    #[test]
    fn means_flags_and_differences_over_workers() {
        let mut values = [1.0, 3.0];
        among(&[3.0, 5.0]).mean(&mut values).unwrap();
        assert_eq!(values, [2.0, 4.0]);
        assert_eq!(among(&[0.0]).any([false, true]).unwrap(), [false, true]);
        assert_eq!(among(&[1.0]).any([false]).unwrap(), [true]);
        let error = among(&[]).any([true]).unwrap_err().to_string();
        for part in ["worker 1 of 2", "the other is gone"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        let error = among(&[7.0]).check_equal([7, 8, 7]).unwrap_err();
        assert!(error.to_string().contains("different samples"), "{error}");
        let alone = &mut WorkerGroup::of(Box::new(SingleWorker));
        alone.check_equal([1, 2, 3]).unwrap();
        let mut values = [1.0];
        alone.mean(&mut values).unwrap();
        assert_eq!(values, [1.0]);
    }
}
