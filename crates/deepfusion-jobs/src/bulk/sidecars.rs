//! Sidecars on the disk. A sidecar is written last, so its presence means that the outputs are complete.

use std::io::Write;
use std::path::{Path, PathBuf};

use deepfusion_data::Error as DataError;
use deepfusion_fs::Content;
use deepfusion_records::Sidecar;
use serde::Serialize;

use crate::Result;
use crate::files::write;

/// Path of the sidecar for a name.
#[must_use]
pub fn sidecar_path(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.json"))
}

/// Adds an existing output with its current content.
///
/// # Errors
/// A file that cannot be read.
pub fn add_output(sidecar: &mut Sidecar, folder: &Path, file: String) -> Result<()> {
    let path = folder.join(&file);
    let content = Content::of(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
    sidecar.files.push(file);
    sidecar.file_bytes.push(content.bytes);
    sidecar.file_crc32.push(format!("{:08x}", content.crc32));
    Ok(())
}

/// Writes sidecars into the folder, by their names, once all their outputs are on the disk: if a sidecar exists, so do its outputs, even
/// after a power cut. Returns when the sidecars are on the disk, too.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write_all<'a>(
    folder: &Path,
    group: impl Iterator<Item = (&'a str, &'a Sidecar)>,
) -> Result<()> {
    let group: Vec<_> = group.collect();
    let failed = |e| deepfusion_data::Error::file(folder, e);
    let outputs = group.iter().flat_map(|(_, sidecar)| &sidecar.files);
    let outputs: Vec<PathBuf> = outputs.map(|file| folder.join(file)).collect();
    deepfusion_fs::sync_files(&outputs).map_err(failed)?;
    deepfusion_fs::sync_folder(folder).map_err(failed)?;
    let mut aside = Vec::new();
    for (name, sidecar) in group {
        let (path, text) = (sidecar_path(folder, name), as_json(sidecar)?);
        let failed = |e| deepfusion_data::Error::file(&path, e);
        let filled = deepfusion_fs::write_aside(&path, failed, |out| put(out, &text, &path));
        aside.push(filled?);
    }
    Ok(deepfusion_fs::publish_all(aside).map_err(failed)?)
}

/// Writes a sidecar into the folder, completely or not at all, without waiting for the disk: for runs that are not resumed.
///
/// # Errors
/// A file that cannot be written.
pub fn write_unsynced(sidecar: &Sidecar, folder: &Path, name: &str) -> Result<()> {
    let path = sidecar_path(folder, name);
    let text = as_json(sidecar)?;
    let failed = |e| DataError::file(&path, e);
    Ok(deepfusion_fs::write_unsynced(&path, failed, |out| {
        put(out, &text, &path)
    })?)
}

/// The outputs that a sidecar lists, each with the content that was written; empty for a sidecar of an older version without checksums.
pub(crate) fn outputs_of(sidecar: &Sidecar) -> impl Iterator<Item = (&str, Content)> {
    let contents = sidecar.file_bytes.iter().zip(&sidecar.file_crc32);
    let outputs = sidecar.files.iter().zip(contents);
    outputs.filter_map(|(file, (bytes, crc32))| {
        let crc32 = u32::from_str_radix(crc32, 16).ok()?;
        let bytes = *bytes;
        Some((file.as_str(), Content { bytes, crc32 }))
    })
}

/// Whether every output exists with the content that was written.
#[must_use]
pub(super) fn is_complete(sidecar: &Sidecar, folder: &Path) -> bool {
    let files = sidecar.files.len();
    if (sidecar.file_bytes.len(), sidecar.file_crc32.len()) != (files, files) {
        return false;
    }
    let mut outputs = outputs_of(sidecar);
    sidecar.files.iter().all(|file| {
        let output = outputs.next().filter(|(of, _)| of == file);
        output.is_some_and(|(_, content)| content.is_of(&folder.join(file)))
    })
}

/// Writes a value as indented JSON, atomically.
///
/// # Errors
/// A file that cannot be written.
pub fn write_json<T: Serialize>(value: &T, path: &Path) -> Result<()> {
    let text = as_json(value)?;
    Ok(write(path, text)?)
}

fn as_json<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    Ok(text)
}

fn put(out: &mut impl Write, text: &[u8], path: &Path) -> Result<(), deepfusion_data::Error> {
    out.write_all(text)
        .map_err(|e| deepfusion_data::Error::file(path, e))
}
