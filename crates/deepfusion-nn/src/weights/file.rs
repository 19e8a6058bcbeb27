//! Weights in files: safetensors, and PyTorch's `.pth`.

use std::path::Path;

use burn::store::pytorch_reader::{DType as TorchDType, PytorchReader};
use burn::tensor::{bf16, f16};
use deepfusion_model::weights::{FileKind, FormatProblem, floats, read_safetensors};

use super::{WeightTensor, Weights};
use crate::Error;

/// Prefix of the weights' names in a file that also has an epoch or an optimiser's state.
const NESTED: &str = "state_dict.";

/// Reads every float tensor of a `.safetensors`, `.pth` or `.pt` file; the format is recognised by content, not by name. f64, f16 and bf16
/// become f32; integers (PyTorch's `num_batches_tracked`) and entries that are not tensors are skipped. If a `.pth` has a `state_dict`
/// beside other entries, as training programs save it, only the `state_dict` is read.
///
/// # Errors
/// [`Error::NoSuchFile`] or [`Error::Io`] if the file cannot be read, [`Error::Format`] if it has no weights.
pub fn read(path: &Path) -> Result<Weights, Error> {
    let weights = match FileKind::of(path)? {
        FileKind::Safetensors => read_safetensors(path)?,
        FileKind::PyTorch => read_pytorch(path)?,
    };
    if weights.tensors.is_empty() {
        return Err(format_error(path, FormatProblem::NoTensors));
    }
    Ok(weights)
}

fn read_pytorch(path: &Path) -> Result<Weights, Error> {
    let unreadable = |error| format_error(path, FormatProblem::Reader(error));
    let reader = PytorchReader::new(path).map_err(|e| unreadable(e.into()))?;
    let mut weights = Weights::new(path.display().to_string());
    for (name, tensor) in reader.into_tensors() {
        let read = || tensor.read().map_err(|e| unreadable(e.into()));
        // The reader returns the machine's own byte order.
        let values = match tensor.dtype() {
            TorchDType::F32 => floats(&read()?, f32::from_ne_bytes),
            TorchDType::F64 => floats(&read()?, |b| f64::from_ne_bytes(b) as f32),
            TorchDType::F16 => floats(&read()?, |b| f16::from_ne_bytes(b).to_f32()),
            TorchDType::BF16 => floats(&read()?, |b| bf16::from_ne_bytes(b).to_f32()),
            _ => continue,
        };
        let shape = tensor.shape().to_vec();
        weights.tensors.insert(name, WeightTensor { shape, values });
    }
    Ok(if weights.tensors.keys().any(|n| n.starts_with(NESTED)) {
        weights.renamed(|name| Some(name.strip_prefix(NESTED)?.to_owned()))
    } else {
        weights
    })
}

fn format_error(path: &Path, reason: FormatProblem) -> Error {
    Error::Format {
        path: path.to_owned(),
        reason,
    }
}
