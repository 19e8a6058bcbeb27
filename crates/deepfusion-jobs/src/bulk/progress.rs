//! The progress of a run: which images are done and which failed, for the manifest and for callbacks.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use deepfusion_records::Sidecar;

use super::manifest::{Manifest, State};
use crate::{Error, Result};

/// Shortest time between two writes of the manifest. After a kill, the sidecars contain what it misses.
const WRITE_EVERY: Duration = Duration::from_secs(5);
/// The pause is also at least this many times the last write: the manifest of a hundred thousand images takes a while, and a slow disk has
/// other files to write.
const TIMES_AS_LONG: u32 = 20;

/// Receives the number of images done or failed, and of all.
type Watcher<'a> = Box<dyn FnMut(usize, usize) + Send + 'a>;

/// The progress of a run's images, shared by its threads. `E` is the error type.
pub struct BulkProgress<'a, E> {
    folder: &'a Path,
    /// Formats an error as one line.
    why: fn(&E) -> String,
    state: Mutex<Shared<'a, E>>,
}

struct Shared<'a, E> {
    manifest: Manifest,
    /// By index in the manifest; empty if they are not wanted.
    sidecars: Vec<Option<Sidecar>>,
    failures: Vec<(usize, E)>,
    /// The error that ended the run: any later image would fail in the same way.
    stop: Option<E>,
    done: usize,
    /// When the manifest is written next; `None` while a thread writes it.
    due: Option<Instant>,
    watcher: Watcher<'a>,
}

/// The result of a run.
pub struct Summary<E> {
    /// Number of images that are done, including those of earlier runs.
    pub done: usize,
    /// Number of images of the shard.
    pub total: usize,
    /// Sidecars of the images that are done, if requested.
    pub sidecars: Vec<Sidecar>,
    /// Images that failed, by their index in the shard.
    pub failures: Vec<(usize, E)>,
    /// The error that ended the run early.
    pub stopped_by: Option<E>,
    /// Whether the last write of the manifest succeeded.
    pub manifest: Result<()>,
}

impl<'a, E: From<Error>> BulkProgress<'a, E> {
    /// The progress of a manifest that may contain finished images. `why` formats an error for the manifest; `watcher` receives the number
    /// of images done or failed, and of all.
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

    /// The folder of the outputs.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder
    }

    /// Records that an image's outputs and sidecar are on the disk.
    pub fn done(&self, image: usize, sidecar: Sidecar) {
        let mut state = self.lock();
        state.done += 1;
        state.manifest.images[image].state = State::Done;
        if let Some(place) = state.sidecars.get_mut(image) {
            *place = Some(sidecar);
        }
        self.report(state);
    }

    /// Records that an image cannot be predicted, with the reason in the manifest. The others can.
    pub fn failed(&self, image: usize, error: E) {
        let why = (self.why)(&error);
        let mut state = self.lock();
        let entry = &mut state.manifest.images[image];
        entry.state = State::Failed;
        entry.error = Some(why);
        state.failures.push((image, error));
        self.report(state);
    }

    /// Records that outputs cannot be written, which ends the run.
    pub fn stop(&self, error: E) {
        self.lock().stop.get_or_insert(error);
    }

    /// Whether the run has to end.
    #[must_use]
    pub fn stopped(&self) -> bool {
        self.lock().stop.is_some()
    }

    /// Writes the manifest a last time and returns the result.
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

    /// Reports the progress, and from time to time writes a copy of the manifest, so that other threads can continue meanwhile.
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
        // A thread that panicked while holding the lock changed only single fields.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The pause after a write of the manifest that took this long.
fn pause_after(writing: Duration) -> Duration {
    WRITE_EVERY.max(writing.saturating_mul(TIMES_AS_LONG))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slowly_written_manifest_is_written_less_often() {
        let pause = |ms| pause_after(Duration::from_millis(ms));
        assert_eq!(pause(3), WRITE_EVERY);
        assert_eq!(pause(2000), Duration::from_secs(40));
    }
}
