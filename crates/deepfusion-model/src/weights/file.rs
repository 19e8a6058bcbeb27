//! Safetensors files: reading and writing.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use deepfusion_fs::Partial;
use half::{bf16, f16};
use safetensors::tensor::{Dtype, Metadata, SafeTensorError, TensorView};

use super::{FormatProblem, WeightTensor, Weights};
use crate::NetworkError;

/// Format of a file of weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A safetensors file.
    Safetensors,
    /// A file written by `torch.save`.
    PyTorch,
}

impl FileKind {
    /// The format, recognised by content and not by name. PyTorch writes a zip archive ("PK"), or before version 1.6 a bare pickle (0x80,
    /// protocol). A safetensors file starts with the length of its JSON header, whose first byte is at offset 8.
    ///
    /// # Errors
    /// [`NetworkError::NoSuchFile`] or [`NetworkError::Io`] for a file that cannot be read, [`NetworkError::Format`] for one of neither format.
    pub fn of(path: &Path) -> Result<Self, NetworkError> {
        let mut start = [0_u8; 9];
        let mut file = fs::File::open(path).map_err(|source| io_error(path, "open", source))?;
        let mut filled = 0;
        while filled < start.len() {
            match file.read(&mut start[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(source) => return Err(io_error(path, "read", source)),
            }
        }
        if filled == start.len() && start[8] == b'{' {
            return Ok(Self::Safetensors);
        }
        if start.starts_with(b"PK") || start[0] == 0x80 {
            return Ok(Self::PyTorch);
        }
        let seen = match &start[..filled] {
            [] => FormatProblem::Empty,
            start => FormatProblem::Unknown {
                start: start.to_owned(),
            },
        };
        Err(format_error(path, seen))
    }
}

/// Reads every float tensor of a safetensors file. f64, f16 and bf16 become f32; integers are skipped.
///
/// # Errors
/// [`NetworkError::NoSuchFile`] or [`NetworkError::Io`] for a file that cannot be read, [`NetworkError::Format`] for one that is not a
/// safetensors file.
pub fn read_safetensors(path: &Path) -> Result<Weights, NetworkError> {
    read_safetensors_under(path, "")
}

/// Like [`read_safetensors`], but only the tensors whose names start with `prefix`, which is removed; there may be none. The others are not
/// even read: a checkpoint also contains the optimiser's state.
///
/// # Errors
/// As for [`read_safetensors`].
pub fn read_safetensors_under(path: &Path, prefix: &str) -> Result<Weights, NetworkError> {
    if FileKind::of(path)? == FileKind::PyTorch {
        return Err(format_error(path, FormatProblem::PyTorch));
    }
    let file = fs::File::open(path).map_err(|source| io_error(path, "open", source))?;
    let length = file
        .metadata()
        .map_err(|source| io_error(path, "read", source))?
        .len();
    safetensors_of(file, length, path, prefix)
}

/// The float tensors of a safetensors file in memory; error messages call it `origin`.
///
/// # Errors
/// [`NetworkError::Format`] for bytes that are not a safetensors file.
pub fn read_bytes(origin: &str, bytes: &[u8]) -> Result<Weights, NetworkError> {
    let length = bytes.len() as u64;
    safetensors_of(std::io::Cursor::new(bytes), length, Path::new(origin), "")
}

/// Reads a file of `length` bytes; error messages call it `path`.
fn safetensors_of(
    mut file: impl Read + Seek,
    length: u64,
    path: &Path,
    prefix: &str,
) -> Result<Weights, NetworkError> {
    let failed = |source| io_error(path, "read", source);
    let cut_off = || format_error(path, FormatProblem::CutOff);
    if length < 8 {
        return Err(cut_off());
    }
    let mut start = [0_u8; 8];
    file.read_exact(&mut start).map_err(failed)?;
    let data = u64::from_le_bytes(start).saturating_add(8);
    if data > length {
        return Err(cut_off());
    }
    let mut header = vec![0; (data - 8) as usize];
    file.read_exact(&mut header).map_err(failed)?;
    let header: Metadata = serde_json::from_slice(&header)
        .map_err(|e| format_error(path, FormatProblem::Header(e)))?;
    if header.data_len() as u64 != length - data {
        return Err(cut_off());
    }
    let mut weights = Weights::new(path.display().to_string());
    if let Some(metadata) = header.metadata() {
        weights.metadata = metadata.clone().into_iter().collect();
    }
    let mut bytes = Vec::new();
    for name in header.offset_keys() {
        let (Some(short), Some(info)) = (name.strip_prefix(prefix), header.info(&name)) else {
            continue;
        };
        let (begin, end) = info.data_offsets;
        file.seek(SeekFrom::Start(data + begin as u64))
            .map_err(failed)?;
        bytes.resize(end - begin, 0);
        file.read_exact(&mut bytes).map_err(failed)?;
        let values = match info.dtype {
            Dtype::F32 => floats(&bytes, f32::from_le_bytes),
            Dtype::F64 => floats(&bytes, |b| f64::from_le_bytes(b) as f32),
            Dtype::F16 => floats(&bytes, |b| f16::from_le_bytes(b).to_f32()),
            Dtype::BF16 => floats(&bytes, |b| bf16::from_le_bytes(b).to_f32()),
            _ => continue,
        };
        let shape = info.shape.clone();
        weights
            .tensors
            .insert(short.to_owned(), WeightTensor { shape, values });
    }
    Ok(weights)
}

/// Converts packed numbers of `N` bytes each; a shorter remainder is left out.
pub fn floats<const N: usize>(bytes: &[u8], convert: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    let (chunks, _) = bytes.as_chunks::<N>();
    chunks.iter().map(|chunk| convert(*chunk)).collect()
}

/// Writes the tensors as f32 to a safetensors file. The file appears under its name only when it is complete and on disk.
///
/// # Errors
/// [`NetworkError::Io`] naming the file; a partly written file is removed.
pub fn write_safetensors(path: &Path, weights: &Weights) -> Result<(), NetworkError> {
    let bytes: Vec<(&String, &WeightTensor, Cow<'_, [u8]>)> = weights
        .tensors
        .iter()
        .map(|(name, tensor)| (name, tensor, little_endian(&tensor.values)))
        .collect();
    let mut views = Vec::with_capacity(bytes.len());
    for (name, tensor, bytes) in &bytes {
        let view = TensorView::new(Dtype::F32, tensor.shape.clone(), bytes);
        let view = view.map_err(|e| {
            let problem = FormatProblem::Tensor {
                name: (*name).clone(),
                source: Box::new(e),
            };
            format_error(path, problem)
        })?;
        views.push((name.as_str(), view));
    }
    let metadata: HashMap<String, String> = weights.metadata.clone().into_iter().collect();
    let part = Partial::beside(path);
    safetensors::serialize_to_file(views, Some(metadata), part.path())
        .map_err(|error| match error {
            SafeTensorError::IoError(source) => io_error(path, "write", source),
            other => format_error(path, FormatProblem::Unwritten(Box::new(other))),
        })
        .and_then(|()| {
            part.publish()
                .map_err(|source| io_error(path, "write", source))
        })
}

/// The numbers in the file's byte order. On most machines this is the order in memory, so a checkpoint is written without a copy.
fn little_endian(values: &[f32]) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        bytemuck::cast_slice(values).into()
    } else {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        bytes.into()
    }
}

fn io_error(path: &Path, action: &'static str, source: std::io::Error) -> NetworkError {
    let path = path.to_owned();
    if action == "open" && source.kind() == ErrorKind::NotFound {
        return NetworkError::NoSuchFile { path };
    }
    NetworkError::Io {
        path,
        action,
        source,
    }
}

fn format_error(path: &Path, reason: FormatProblem) -> NetworkError {
    NetworkError::Format {
        path: path.to_owned(),
        reason,
    }
}
