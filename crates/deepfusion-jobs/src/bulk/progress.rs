//! How far a run is: which images are done and which failed, for the manifest and for who waits.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use deepfusion_records::Sidecar;

use super::manifest::{Manifest, State};
use crate::{Error, Result};

/// How often the manifest is written while images are done. After a kill the sidecars tell what it does not.
const WRITE_EVERY: Duration = Duration::from_secs(5);

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
    written: Instant,
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
            written: Instant::now(),
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
        self.report(&mut state);
    }

    /// An image cannot be predicted; the others can. The manifest keeps why.
    pub fn failed(&self, image: usize, error: E) {
        let why = (self.why)(&error);
        let mut state = self.lock();
        let entry = &mut state.manifest.images[image];
        entry.state = State::Failed;
        entry.error = Some(why);
        state.failures.push((image, error));
        self.report(&mut state);
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

    fn report(&self, state: &mut Shared<'a, E>) {
        let (done, total) = (
            state.done + state.failures.len(),
            state.manifest.images.len(),
        );
        (state.watcher)(done, total);
        if state.written.elapsed() < WRITE_EVERY {
            return;
        }
        if let Err(error) = state.manifest.write(self.folder) {
            state.stop.get_or_insert(error.into());
        }
        state.written = Instant::now();
    }

    fn lock(&self) -> MutexGuard<'_, Shared<'a, E>> {
        // Whoever panicked while holding it changed single fields only.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
