//! Writes the ground truth of many frames into one `.npz`.

use super::ground_truth_names;
use crate::{ArrayProblem, Dataset, Error, GtKind, Result};
use ndarray::ArrayView2;
use ndarray_npy::{NpzWriter, WriteNpyError, WriteNpzError};
use std::collections::HashSet;
use std::path::Path;

/// Prefix of a frame's name for the array of its velocities in the file that [`export_gt`] writes.
pub const VELOCITY: &str = "velocity_mps/";

/// Writes the sparse depth of every selected frame that has a scan into a compressed `.npz`, as H×W f32 arrays in metres, 0 = no
/// depth; returns their number. `progress` is called with (done, total) after each frame.
///
/// The arrays are in the order of the split's lines ([`Dataset::split_places`]), so that predictions without names, which are in that
/// order, match them. Frames without a place in the split come last, in the order of the data sets. Names are those of
/// [`ground_truth_names`]. A frame given twice is written once.
///
/// A frame whose scan has radial velocities gets a second array of that size, [`crate::ScanTruth::velocity_mps`], whose name is the
/// frame's with the prefix [`VELOCITY`].
///
/// # Errors
/// [`Error::NoScans`] if no frame has a scan, [`Error::Array`] or [`Error::File`] if writing fails, and
/// those of [`Dataset::ground_truth`]. After an error, `out` does not exist.
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

/// A selected frame, and the name of its array.
struct NamedFrame<'a> {
    dataset: &'a Dataset,
    index: usize,
    name: &'a str,
    /// Its place in the split.
    place: Option<usize>,
}

/// The selected frames in the order of the split, without duplicates.
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

/// Extracts the system's error from the array writer's, so that a full disk is reported as such.
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
