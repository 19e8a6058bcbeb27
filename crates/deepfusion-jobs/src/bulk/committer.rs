//! Marks images as done: their outputs are synced first, then their sidecars are written, many images at a time.
//!
//! A disk takes milliseconds for each sync, and hardly more for many at once. So the threads that write outputs do not wait; one thread
//! takes all images that were written while it waited for the previous ones.

use crossbeam_channel::{Receiver, Sender, bounded};
use deepfusion_records::Sidecar;

use super::progress::BulkProgress;
use super::sidecars;
use crate::{Error, Input};

/// Largest number of images that may wait for the disk: a power cut costs at most twice as many.
const MOST: usize = 64;

/// An image's index in the shard, and its sidecar.
pub type Written = (usize, Sidecar);

/// The queue to [`commit`].
#[must_use]
pub fn queue() -> (Sender<Written>, Receiver<Written>) {
    bounded(MOST)
}

/// Writes the sidecars of images whose outputs are written, group by group, until the queue closes.
pub fn commit<E: From<Error>>(
    progress: &BulkProgress<E>,
    mine: &[&Input],
    written: &Receiver<Written>,
) {
    while let Ok(first) = written.recv() {
        let group: Vec<Written> = std::iter::once(first)
            .chain(written.try_iter().take(MOST - 1))
            .collect();
        let named = group
            .iter()
            .map(|(image, sidecar)| (mine[*image].name.as_str(), sidecar));
        match sidecars::write_all(progress.folder(), named) {
            Ok(()) => group
                .into_iter()
                .for_each(|(image, sidecar)| progress.done(image, sidecar)),
            Err(error) => progress.stop(error.into()),
        }
    }
}
