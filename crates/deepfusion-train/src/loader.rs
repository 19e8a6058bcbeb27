//! Batches prepared ahead of the trainer, on their own thread.

use crate::{Error, LoaderProblem, ThreadsProblem};
use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, sync_channel};

/// Number of batches prepared ahead of the trainer.
const AHEAD: usize = 3;

/// The items that a loader's thread makes, in order.
pub(crate) struct Ahead<T> {
    /// `None` marks the end. A channel that closes without it has lost its thread.
    made: Receiver<Result<Option<T>, Error>>,
    ended: Cell<bool>,
}

impl<T: Send + 'static> Ahead<T> {
    /// Makes one item for each plan, on `threads` threads. The plans' numbers are used only in messages.
    pub(crate) fn start<P: Send + Sync + 'static>(
        threads: usize,
        plans: impl Iterator<Item = (usize, P)> + Send + 'static,
        make: impl Fn(usize, &P) -> Result<T, Error> + Send + Sync + 'static,
    ) -> Self {
        let (sender, receiver) = sync_channel(AHEAD);
        let complaints = sender.clone();
        let run = move |pool: rayon::ThreadPool| {
            for (number, plan) in plans {
                let make = || pool.install(|| make(number, &plan));
                let one = catch_unwind(AssertUnwindSafe(make))
                    .unwrap_or_else(|panic| Err(panicked(number, &*panic)));
                let failed = one.is_err();
                // The thread ends when the receiver is dropped: `send` fails then.
                if sender.send(one.map(Some)).is_err() || failed {
                    return;
                }
            }
            sender.send(Ok(None)).ok();
        };
        if let Err(error) = start_thread(threads, run) {
            // `send` succeeds: the receiver is alive, and the empty channel has room.
            complaints.send(Err(error)).ok();
        }
        Self {
            made: receiver,
            ended: Cell::new(false),
        }
    }

    /// The next one; `None` after the last.
    ///
    /// # Errors
    /// The error from making the item; [`Error::Threads`] if the thread could not start; [`Error::Loader`] if it has died.
    pub(crate) fn next(&self) -> Option<Result<T, Error>> {
        if self.ended.get() {
            return None;
        }
        match self.made.recv() {
            Ok(Ok(Some(one))) => Some(Ok(one)),
            Ok(Ok(None)) => {
                self.ended.set(true);
                None
            }
            Ok(Err(error)) => Some(Err(error)),
            Err(_) => {
                let reason = LoaderProblem::Ended;
                Some(Err(Error::Loader { reason }))
            }
        }
    }
}

/// Runs `make` on a thread with a rayon pool of its own. The global pool could deadlock: the trainer waits for a batch on one of its
/// threads, which may be the only one.
fn start_thread(
    threads: usize,
    make: impl FnOnce(rayon::ThreadPool) + Send + 'static,
) -> Result<(), Error> {
    let failed = |reason| Error::Threads { reason };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| failed(ThreadsProblem::Pool(e)))?;
    std::thread::Builder::new()
        .name("batches".into())
        .spawn(move || make(pool))
        .map_err(|e| failed(ThreadsProblem::Thread(e)))?;
    Ok(())
}

/// The error for a panic while a batch was being made.
fn panicked(number: usize, panic: &(dyn Any + Send)) -> Error {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    Error::Loader {
        reason: LoaderProblem::Panicked {
            batch: number,
            text: text.map(str::to_owned),
        },
    }
}
