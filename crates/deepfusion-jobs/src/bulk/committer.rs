//! When an image counts as done: outputs are on the disk, then sidecars, many images at a time.
//!
//! A disk takes milliseconds for each thing that is waited for, and hardly more for many at once. So the threads that write
//! outputs wait for nothing; one thread takes all images that were written while it waited for those before.

use crossbeam_channel::{Receiver, Sender, bounded};
use deepfusion_records::Sidecar;

use super::progress::BulkProgress;
use super::sidecars;
use crate::{Error, Input};

/// Images that may wait for the disk: a power cut costs no more than twice these.
const MOST: usize = 64;

/// An image's place among the shard's, and its sidecar.
pub type Written = (usize, Sidecar);

/// The queue to [`commit`].
#[must_use]
pub fn queue() -> (Sender<Written>, Receiver<Written>) {
    bounded(MOST)
}

/// Writes the sidecars of images whose outputs are written, group by group, until no more come.
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
