//! Runners for input sizes other than the training size.

use std::fmt;
use std::sync::{Arc, OnceLock};

use deepfusion_model::InputSize;

use crate::{DepthRunner, Error, RunnerPlan};

/// Number of other input sizes for which an estimator keeps runners. Each camera needs one, or as many as [`crate::Augmentation::scales`].
const SIZES_KEPT: usize = 6;

/// Number of other input sizes for which packed weights are shared. It is larger than what an estimator keeps, because these entries are
/// never removed: four times [`SIZES_KEPT`] is enough for four cameras at six scales.
const SIZES_SHARED: usize = 24;

/// Runners for other input sizes, made on demand.
pub(crate) struct OtherSizes {
    shared: Arc<SharedSizes>,
    /// Most recently used last.
    made: Vec<(InputSize, Box<dyn DepthRunner>)>,
}

/// What estimators of one network share among threads.
struct SharedSizes {
    make: Box<MakeRunner>,
    /// The first sizes that were requested. Entries are added in order and never removed, so that reading needs no lock.
    packed: [OnceLock<PackedSize>; SIZES_SHARED],
}

/// Packed weights for one size. (ONNX Runtime shares only the model's bytes.)
type PackedSize = (InputSize, Arc<dyn RunnerPlan>);

type MakeRunner = dyn Fn(InputSize) -> Result<Box<dyn DepthRunner>, Error> + Send + Sync;

impl fmt::Debug for OtherSizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OtherSizes").finish_non_exhaustive()
    }
}

impl OtherSizes {
    /// No runners yet; `make` creates one for a size for which nothing is packed.
    pub(crate) fn new(
        make: impl Fn(InputSize) -> Result<Box<dyn DepthRunner>, Error> + Send + Sync + 'static,
    ) -> Self {
        Self {
            shared: Arc::new(SharedSizes {
                make: Box::new(make),
                packed: [const { OnceLock::new() }; SIZES_SHARED],
            }),
            made: Vec::new(),
        }
    }

    /// The same sizes for another thread.
    ///
    /// # Errors
    /// As for [`DepthRunner::another`].
    pub(crate) fn another(&self) -> Result<Self, Error> {
        let made = self.made.iter();
        let made = made.map(|(size, runner)| Ok((*size, runner.another()?)));
        Ok(Self {
            shared: Arc::clone(&self.shared),
            made: made.collect::<Result<_, Error>>()?,
        })
    }

    /// The runner for a size.
    ///
    /// # Errors
    /// The error of creating the runner.
    pub(crate) fn runner(&mut self, size: InputSize) -> Result<&mut dyn DepthRunner, Error> {
        let found = match self.made.iter().position(|(of, _)| *of == size) {
            Some(place) => self.made.remove(place),
            None => (size, self.shared.runner(size)?),
        };
        if self.made.len() == SIZES_KEPT {
            self.made.remove(0);
        }
        self.made.push(found);
        let last = self.made.len() - 1;
        Ok(&mut *self.made[last].1)
    }
}

impl SharedSizes {
    fn runner(&self, size: InputSize) -> Result<Box<dyn DepthRunner>, Error> {
        let mut packed = self.packed.iter().filter_map(OnceLock::get);
        if let Some((_, plan)) = packed.find(|(of, _)| *of == size) {
            return plan.runner();
        }
        // No thread waits while a size is packed. Packing is parallel work: a thread that waits for its own part may take up a task of
        // another estimator, which would wait for this one. So two threads may pack the same size at once; both then keep the first result.
        let runner = (self.make)(size)?;
        match self.publish(size, runner.plan()) {
            Some(first) => {
                drop(runner);
                first.runner()
            }
            None => Ok(runner),
        }
    }

    /// Shares what was packed for a size if there is a free entry. Returns what another thread has packed in the meantime, if so.
    fn publish(&self, size: InputSize, plan: Arc<dyn RunnerPlan>) -> Option<&dyn RunnerPlan> {
        let mut ours = (size, plan);
        for place in &self.packed {
            match place.set(ours) {
                Ok(()) => return None,
                Err(refused) => ours = refused,
            }
            if let Some((of, first)) = place.get()
                && *of == size
            {
                return Some(&**first);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NetworkOutput;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A runner without a network, with itself as its packed form.
    #[derive(Debug, Clone, Copy)]
    struct Idle;

    impl DepthRunner for Idle {
        fn name(&self) -> &'static str {
            "idle"
        }

        fn run(&mut self, _: &[f32], _: &mut NetworkOutput) -> Result<(), Error> {
            Ok(())
        }

        fn plan(&self) -> Arc<dyn RunnerPlan> {
            Arc::new(*self)
        }
    }

    impl RunnerPlan for Idle {
        fn runner(&self) -> Result<Box<dyn DepthRunner>, Error> {
            Ok(Box::new(*self))
        }
    }

    fn size(number: usize) -> InputSize {
        InputSize {
            width: 64 + 32 * number,
            height: 64,
        }
    }

    #[test]
    fn packed_weights_of_the_first_sizes_are_shared() {
        let packed = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&packed);
        let mut first = OtherSizes::new(move |_| {
            count.fetch_add(1, Ordering::Relaxed);
            Ok(Box::new(Idle))
        });
        let mut second = first.another().unwrap();
        let sizes = SIZES_SHARED + 2;
        for number in 0..sizes {
            first.runner(size(number)).unwrap();
        }
        assert_eq!(packed.load(Ordering::Relaxed), sizes);
        // Beyond that number, each thread packs its own and keeps the most recently used.
        for number in (0..sizes).chain(SIZES_SHARED..sizes) {
            second.runner(size(number)).unwrap();
        }
        assert_eq!(packed.load(Ordering::Relaxed), sizes + 2);
        // The first size was dropped from the first thread's own list, but not from the shared entries.
        first.runner(size(0)).unwrap();
        assert_eq!(packed.load(Ordering::Relaxed), sizes + 2);
    }

    #[test]
    fn of_two_packed_at_once_the_first_is_kept() {
        let sizes = OtherSizes::new(|_| Ok(Box::new(Idle)));
        let shared = &sizes.shared;
        assert!(shared.publish(size(0), Idle.plan()).is_none());
        assert!(shared.publish(size(1), Idle.plan()).is_none());
        assert!(shared.publish(size(1), Idle.plan()).is_some());
        let taken = shared.packed.iter().filter_map(OnceLock::get);
        assert_eq!(
            taken.map(|(of, _)| *of).collect::<Vec<_>>(),
            [size(0), size(1)]
        );
    }
}
