//! Depth of many images: while the network runs on one, the next are read and the previous ones written.

use deepfusion_runtime::{DepthEstimator, PreparedImage};

use super::pipeline::{self, Threads};
use super::{BulkProgress, DepthJob, LoadedImage, commit, queue};
use crate::outputs::SeenDepth;
use crate::{Error, Input, Result};

/// Predicts the images `todo` of `mine`, and writes their outputs; an image's sidecar comes last, once the rest is on the disk. Results go
/// to `progress`. An image that cannot be read only fails itself; if predicting or writing fails, the run ends. It also ends, with the
/// images in progress, when `stop` returns true.
///
/// # Panics
/// If one of its threads panics.
pub fn predict<E: From<Error> + Send>(
    job: &DepthJob<'_>,
    estimator: &mut DepthEstimator,
    mine: &[&Input],
    todo: &[usize],
    progress: &BulkProgress<'_, E>,
    stop: &(dyn Fn() -> bool + Sync),
) {
    let load = |i: usize| match job.load(mine[todo[i]]) {
        Ok((loaded, prepared)) => Some((i, loaded, prepared)),
        Err(error) => {
            progress.failed(todo[i], error.into());
            None
        }
    };
    let mut watch = job.watch();
    let infer = |(i, loaded, prepared): (usize, LoadedImage, PreparedImage)| {
        let input = mine[todo[i]];
        let seen = job.predict_next(estimator, &mut watch, input, (&loaded, &prepared));
        (loaded, seen)
    };
    let (to_disk, written) = queue();
    let write = move |i: usize, (loaded, seen): (LoadedImage, Result<SeenDepth>)| {
        let input = mine[todo[i]];
        match seen.and_then(|seen| job.writer.write_outputs(input, &loaded, &seen)) {
            // Fails only if the other thread has panicked, which ends the program below.
            Ok(sidecar) => drop(to_disk.send((todo[i], sidecar))),
            Err(error) => progress.stop(error.into()),
        }
    };
    let stop = || stop() || progress.stopped();
    let threads = Threads::for_this_machine();
    std::thread::scope(|scope| {
        // It owns its end of the queue: if it panics, no other thread waits for it.
        scope.spawn(move || commit(progress, mine, &written));
        pipeline::run(todo.len(), threads, &stop, &load, infer, &write);
        // The committer ends after the last image.
        drop(write);
    });
}
