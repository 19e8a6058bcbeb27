//! How far a run is: which images are done and which failed, for the manifest and for who waits.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use deepfusion_records::Sidecar;

use super::manifest::{Manifest, State};
use crate::{Error, Result};

/// How long after one writing of the manifest the next is due, at least. After a kill the sidecars tell what it does not.
const WRITE_EVERY: Duration = Duration::from_secs(5);
/// How many times as long as the last writing took: that of a hundred thousand images takes a while, and a slow disk has other things to write.
const TIMES_AS_LONG: u32 = 20;

/// Sees how many images are done or failed, and how many there are.
type Watcher<'a> = Box<dyn FnMut(usize, usize) + Send + 'a>;

/// What is known of a run's images. Threads share it. `E` is what fails.
pub struct BulkProgress<'a, E> {
    folder: &'a Path,
    /// An error in a line.
    why: fn(&E) -> String,
    state: Mutex<Shared<'a, E>>,
}

struct Shared<'a, E> {
    manifest: Manifest,
    /// By place in the manifest; empty where nobody wants them.
    sidecars: Vec<Option<Sidecar>>,
    failures: Vec<(usize, E)>,
    /// What ended the run: no later image would fare better.
    stop: Option<E>,
    done: usize,
    /// When the manifest is to be written next; `None` while a thread does.
    due: Option<Instant>,
    watcher: Watcher<'a>,
}

/// How a run ended.
pub struct Summary<E> {
    /// Images that are done, earlier runs' included.
    pub done: usize,
    /// Images of the shard.
    pub total: usize,
    /// Sidecars of those that are done, where they were asked for.
    pub sidecars: Vec<Sidecar>,
    /// Images that failed, by their place in the shard.
    pub failures: Vec<(usize, E)>,
    /// What ended the run before its end.
    pub stopped_by: Option<E>,
    /// Whether the manifest could be written a last time.
    pub manifest: Result<()>,
}

impl<'a, E: From<Error>> BulkProgress<'a, E> {
    /// For a manifest that may have images done already; `why` puts an error into a line of the manifest, `watcher` sees the images done or
    /// failed, and all.
    #[must_use]
    pub fn new(
        folder: &'a Path,
        manifest: Manifest,
        sidecars: Vec<Option<Sidecar>>,
        why: fn(&E) -> String,
        watcher: impl FnMut(usize, usize) + Send + 'a,
    ) -> Self {
        let state = Shared {
            done: manifest.done(),
            manifest,
            sidecars,
            failures: Vec::new(),
            stop: None,
            due: Some(Instant::now() + WRITE_EVERY),
            watcher: Box::new(watcher),
        };
        Self {
            folder,
            why,
            state: Mutex::new(state),
        }
    }

    /// Where the outputs lie.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder
    }

    /// An image's outputs and sidecar are on the disk.
    pub fn done(&self, image: usize, sidecar: Sidecar) {
        let mut state = self.lock();
        state.done += 1;
        state.manifest.images[image].state = State::Done;
        if let Some(place) = state.sidecars.get_mut(image) {
            *place = Some(sidecar);
        }
        self.report(state);
    }

    /// An image cannot be predicted; the others can. The manifest keeps why.
    pub fn failed(&self, image: usize, error: E) {
        let why = (self.why)(&error);
        let mut state = self.lock();
        let entry = &mut state.manifest.images[image];
        entry.state = State::Failed;
        entry.error = Some(why);
        state.failures.push((image, error));
        self.report(state);
    }

    /// Outputs cannot be written: the run ends.
    pub fn stop(&self, error: E) {
        self.lock().stop.get_or_insert(error);
    }

    /// Whether the run is to end.
    #[must_use]
    pub fn stopped(&self) -> bool {
        self.lock().stop.is_some()
    }

    /// Writes the manifest a last time.
    #[must_use]
    pub fn finish(self) -> Summary<E> {
        let mut state = self
            .state
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        state.failures.sort_by_key(|(image, _)| *image);
        Summary {
            manifest: state.manifest.write(self.folder),
            done: state.done,
            total: state.manifest.images.len(),
            sidecars: state.sidecars.into_iter().flatten().collect(),
            failures: state.failures,
            stopped_by: state.stop,
        }
    }

    /// Says how far it is, and now and then writes the manifest, as it was: while the disk takes its time, others may go on.
    fn report(&self, mut state: MutexGuard<'_, Shared<'a, E>>) {
        let (done, total) = (
            state.done + state.failures.len(),
            state.manifest.images.len(),
        );
        (state.watcher)(done, total);
        if state.due.is_none_or(|due| Instant::now() < due) {
            return;
        }
        state.due = None;
        let manifest = state.manifest.clone();
        drop(state);
        let begun = Instant::now();
        let written = manifest.write(self.folder);
        let pause = pause_after(begun.elapsed());
        let mut state = self.lock();
        state.due = Instant::now().checked_add(pause);
        if let Err(error) = written {
            state.stop.get_or_insert(error.into());
        }
    }

    fn lock(&self) -> MutexGuard<'_, Shared<'a, E>> {
        // Whoever panicked while holding it changed single fields only.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How long nothing is written after a writing that took so long.
fn pause_after(writing: Duration) -> Duration {
    WRITE_EVERY.max(writing.saturating_mul(TIMES_AS_LONG))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_long_to_write_is_written_less_often() {
        let pause = |ms| pause_after(Duration::from_millis(ms));
        assert_eq!(pause(3), WRITE_EVERY);
        assert_eq!(pause(2000), Duration::from_secs(40));
    }
}
