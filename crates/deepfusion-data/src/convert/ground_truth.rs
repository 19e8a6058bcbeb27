//! Ground truth of many frames in one `.npz`.

use crate::{ArrayProblem, Dataset, Error, GtKind, Result};
use ndarray::ArrayView2;
use ndarray_npy::{NpzWriter, WriteNpyError, WriteNpzError};
use std::collections::HashSet;
use std::path::Path;

/// The names under which the selected frames of `datasets` appear in array files, a list for each data
/// set: `0000000005`, or `<drive>/0000000005` where there are several drives, with the camera's folder
/// between where there are both cameras.
#[must_use]
pub fn ground_truth_names(datasets: &[Dataset]) -> Vec<Vec<String>> {
    let drives: HashSet<_> = datasets.iter().map(Dataset::split_name).collect();
    let cameras: HashSet<_> = datasets.iter().map(Dataset::camera).collect();
    let name = |dataset: &Dataset, frame: usize| {
        let mut name = String::new();
        if drives.len() > 1 {
            name += &format!("{}/", dataset.name());
        }
        if cameras.len() > 1 {
            name += &format!("image_0{}/", dataset.camera().number());
        }
        name + &format!("{:010}", dataset.frames()[frame].number)
    };
    datasets
        .iter()
        .map(|d| d.selected().iter().map(|f| name(d, *f)).collect())
        .collect()
}

/// Before a frame's name: its velocities in the file that [`export_gt`] writes.
pub const VELOCITY: &str = "velocity_mps/";

/// Writes the sparse depth of every selected frame that has a scan as H×W f32 arrays, metres, 0 =
/// none, into a compressed `.npz`; returns how many. `progress` is called with (done, all) after each frame.
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
    let total: usize = datasets.iter().map(|d| d.selected().len()).sum();
    let names = ground_truth_names(datasets);
    let mut written = 0;
    deepfusion_fs::write_atomically(
        out,
        |e| Error::file(out, e),
        |file| {
            let mut npz = NpzWriter::new_compressed(file);
            let mut done = 0;
            for (dataset, names) in datasets.iter().zip(&names) {
                for (&frame, name) in dataset.selected().iter().zip(names) {
                    if let Some(truth) = dataset.scan_truth(frame, kind)? {
                        let mut add = |name: &str, values: &[f32]| -> Result<()> {
                            let size = (truth.depth.height, truth.depth.width);
                            let array = ArrayView2::from_shape(size, values)
                                .map_err(|e| failed(out, ArrayProblem::Shape(e)))?;
                            npz.add_array(name, &array).map_err(|e| write_error(out, e))
                        };
                        add(name, &truth.depth.data)?;
                        if let Some(velocity) = &truth.velocity_mps {
                            add(&format!("{VELOCITY}{name}"), velocity)?;
                        }
                        written += 1;
                    }
                    done += 1;
                    progress(done, total);
                }
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
