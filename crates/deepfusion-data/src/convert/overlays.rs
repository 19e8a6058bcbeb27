//! Pictures of a recording's measured depth drawn on its images.

use std::fs::create_dir_all;
use std::path::{Path, PathBuf};

use super::ground_truth_names;
use crate::{Dataset, Error, GtKind, OpenOptions, Result, overlay, save_png};

/// Writes a picture ([`overlay`]) of every frame of a recording that has a scan into a folder, named by [`ground_truth_names`]; returns
/// their number. `progress` is called with (done, total) after each frame.
///
/// # Errors
/// [`Error::NoScans`] if no frame has a scan, [`Error::File`] if writing fails, and those of [`Dataset::open`], [`Dataset::load_image`] and
/// [`Dataset::ground_truth`].
pub fn write_overlays(
    path: &Path,
    options: &OpenOptions,
    folder: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<usize> {
    let datasets = Dataset::open(path, options)?;
    let names = ground_truth_names(&datasets);
    let total = names.iter().map(Vec::len).sum();
    let (mut done, mut written) = (0, 0);
    for (dataset, names) in datasets.iter().zip(&names) {
        for (&frame, name) in dataset.selected().iter().zip(names) {
            if let Some(depth) = dataset.ground_truth(frame, GtKind::Z)? {
                let picture = overlay(&dataset.load_image(frame)?, &depth)?;
                save_png(&picture, &picture_path(folder, name)?)?;
                written += 1;
            }
            done += 1;
            progress(done, total);
        }
    }
    if written == 0 {
        return Err(Error::NoScans {
            path: path.to_owned(),
            frames: total,
        });
    }
    Ok(written)
}

/// `<folder>/<name>.png`, where the name may contain the drive's folder.
fn picture_path(folder: &Path, name: &str) -> Result<PathBuf> {
    let path = folder.join(format!("{name}.png"));
    if let Some(parent) = path.parent() {
        create_dir_all(parent).map_err(|e| Error::file(parent, e))?;
    }
    Ok(path)
}
