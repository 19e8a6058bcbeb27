//! Ground truth of many frames in one `.npz`.

use super::ground_truth_names;
use crate::{ArrayProblem, Dataset, Error, GtKind, Result};
use ndarray::ArrayView2;
use ndarray_npy::{NpzWriter, WriteNpyError, WriteNpzError};
use std::collections::HashSet;
use std::path::Path;

/// Before a frame's name: its velocities in the file that [`export_gt`] writes.
pub const VELOCITY: &str = "velocity_mps/";

/// Writes the sparse depth of every selected frame that has a scan as H×W f32 arrays, metres, 0 =
/// none, into a compressed `.npz`; returns how many. `progress` is called with (done, all) after each frame.
///
/// They are in the order of the split's lines ([`Dataset::split_places`]), so that predictions without names, which are in that order, meet
/// theirs; what has no place there comes last, in the order of the data sets. Names are [`ground_truth_names`]'; a frame given twice is
/// written once.
///
/// A frame whose scan has radial velocities has a second array of that size, named with [`VELOCITY`] before its name:
/// [`crate::ScanTruth::velocity_mps`].
///
/// # Errors
/// [`Error::NoScans`] if no frame has one, [`Error::Array`] or [`Error::File`] if writing fails, and
/// as [`Dataset::ground_truth`]. Nothing is left at `out` then.
pub fn export_gt(
    datasets: &[Dataset],
    kind: GtKind,
    out: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<usize> {
    let names = ground_truth_names(datasets);
    let frames = in_split_order(datasets, &names);
    let total = frames.len();
    let mut written = 0;
    deepfusion_fs::write_atomically(
        out,
        |e| Error::file(out, e),
        |file| {
            let mut npz = NpzWriter::new_compressed(file);
            for (done, frame) in (1..).zip(&frames) {
                if let Some(truth) = frame.dataset.scan_truth(frame.index, kind)? {
                    let mut add = |name: &str, values: &[f32]| -> Result<()> {
                        let size = (truth.depth.height, truth.depth.width);
                        let array = ArrayView2::from_shape(size, values)
                            .map_err(|e| failed(out, ArrayProblem::Shape(e)))?;
                        npz.add_array(name, &array).map_err(|e| write_error(out, e))
                    };
                    add(frame.name, &truth.depth.data)?;
                    if let Some(velocity) = &truth.velocity_mps {
                        add(&format!("{VELOCITY}{}", frame.name), velocity)?;
                    }
                    written += 1;
                }
                progress(done, total);
            }
            if written == 0 {
                return Err(Error::NoScans {
                    path: datasets
                        .first()
                        .map_or_else(|| out.to_owned(), |d| d.folder().to_owned()),
                    frames: total,
                });
            }
            npz.finish().map_err(|e| write_error(out, e))?;
            Ok(())
        },
    )?;
    Ok(written)
}

/// A selected frame, and what its array is called.
struct NamedFrame<'a> {
    dataset: &'a Dataset,
    index: usize,
    name: &'a str,
    /// In the split.
    place: Option<usize>,
}

/// The selected frames, each once, in the order of the split.
fn in_split_order<'a>(datasets: &'a [Dataset], names: &'a [Vec<String>]) -> Vec<NamedFrame<'a>> {
    let mut frames = Vec::new();
    for (dataset, names) in datasets.iter().zip(names) {
        let selected = dataset.selected().iter().zip(dataset.split_places());
        frames.extend(
            selected
                .zip(names)
                .map(|((index, place), name)| NamedFrame {
                    dataset,
                    index: *index,
                    name: name.as_str(),
                    place: *place,
                }),
        );
    }
    frames.sort_by_key(|frame| (frame.place.is_none(), frame.place));
    let mut seen = HashSet::new();
    frames.retain(|frame| seen.insert(frame.name));
    frames
}

/// The system's error inside the array writer's, so that a full disk is reported as such.
fn write_error(out: &Path, error: WriteNpzError) -> Error {
    match error {
        WriteNpzError::Npy(WriteNpyError::Io(source)) => Error::file(out, source),
        other => failed(out, ArrayProblem::Write(Box::new(other))),
    }
}

fn failed(out: &Path, problem: ArrayProblem) -> Error {
    Error::Array {
        path: out.to_owned(),
        problem,
    }
}
