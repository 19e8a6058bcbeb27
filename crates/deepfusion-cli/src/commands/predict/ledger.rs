//! The run's book: which images are done and which failed, told to the manifest and the person who waits.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::manifest::{Manifest, State};
use super::sidecar::Sidecar;
use crate::error::CliError;
use crate::failure::{Failure, Result};
use crate::interrupt;
use crate::progress::Progress;

/// How often the manifest is written while images are done. After a kill the sidecars tell what it does not.
const WRITE_EVERY: Duration = Duration::from_secs(5);

/// What is known of a run's images. Threads share it.
pub struct Ledger<'a> {
    folder: &'a Path,
    book: Mutex<Book>,
}

struct Book {
    manifest: Manifest,
    /// By place in the manifest; empty where nobody wants them.
    sidecars: Vec<Option<Sidecar>>,
    failures: Vec<(usize, Failure)>,
    /// What ended the run: no later image would fare better.
    stop: Option<Failure>,
    done: usize,
    written: Instant,
    progress: Progress,
}

/// How a run ended.
pub struct Summary {
    /// Images that are done, earlier runs' included.
    pub done: usize,
    /// Their sidecars, where they were asked for.
    pub sidecars: Vec<Sidecar>,
    /// An error unless all images are done.
    pub outcome: Result<()>,
}

impl<'a> Ledger<'a> {
    /// For a manifest that may have images done already.
    pub fn new(folder: &'a Path, manifest: Manifest, sidecars: Vec<Option<Sidecar>>) -> Self {
        let is_done = |e: &&super::manifest::Entry| e.state == State::Done;
        let book = Book {
            done: manifest.images.iter().filter(is_done).count(),
            manifest,
            sidecars,
            failures: Vec::new(),
            stop: None,
            written: Instant::now(),
            progress: Progress::new("predicting"),
        };
        Self {
            folder,
            book: Mutex::new(book),
        }
    }

    /// Where the outputs lie.
    pub fn folder(&self) -> &Path {
        self.folder
    }

    /// An image's outputs and sidecar are on the disk.
    pub fn done(&self, image: usize, sidecar: Sidecar) {
        let mut book = self.lock();
        book.done += 1;
        book.manifest.images[image].state = State::Done;
        if let Some(place) = book.sidecars.get_mut(image) {
            *place = Some(sidecar);
        }
        self.tell(&mut book);
    }

    /// An image cannot be predicted; the others can.
    pub fn failed(&self, image: usize, error: Failure) {
        let mut book = self.lock();
        let entry = &mut book.manifest.images[image];
        entry.state = State::Failed;
        entry.error = Some(error.one_line());
        book.failures.push((image, error));
        self.tell(&mut book);
    }

    /// Outputs cannot be written: the run ends.
    pub fn stop(&self, error: Failure) {
        self.lock().stop.get_or_insert(error);
    }

    /// Whether the run is to end.
    pub fn stopped(&self) -> bool {
        self.lock().stop.is_some()
    }

    /// Writes the manifest a last time.
    pub fn finish(self) -> Result<Summary> {
        let mut book = self
            .book
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let written = book.manifest.write(self.folder);
        let total = book.manifest.images.len();
        book.failures.sort_by_key(|(image, _)| *image);
        let (done, failed) = (book.done, book.failures.len());
        let outcome = if let Some(error) = book.stop {
            Err(error)
        } else if failed == 1 && total == 1 {
            Err(book.failures.remove(0).1)
        } else if failed > 0 {
            let hint = book.failures.iter().find_map(|(_, error)| error.hint());
            let failures = book.failures.iter().map(|(_, e)| e.one_line()).collect();
            Err(CliError::SomeFailed {
                failures,
                total,
                interrupted: interrupt::asked() && done + failed < total,
                hint,
            }
            .into())
        } else if done < total {
            Err(CliError::Interrupted { done, total }.into())
        } else {
            Ok(())
        };
        // A full disk is told once, as the reason for stopping.
        if outcome.is_ok() {
            written?;
        }
        Ok(Summary {
            done,
            sidecars: book.sidecars.into_iter().flatten().collect(),
            outcome,
        })
    }

    fn tell(&self, book: &mut Book) {
        let (done, total) = (book.done + book.failures.len(), book.manifest.images.len());
        book.progress.set(done, total);
        if book.written.elapsed() < WRITE_EVERY {
            return;
        }
        if let Err(error) = book.manifest.write(self.folder) {
            book.stop.get_or_insert(error);
        }
        book.written = Instant::now();
    }

    fn lock(&self) -> MutexGuard<'_, Book> {
        // Whoever panicked while holding it changed single fields only.
        self.book.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
