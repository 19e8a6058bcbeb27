//! Weights by name, in memory and in safetensors files with f32 values.
//!
//! A tensor's name is its path in the network, `encoder.layer1.0.conv1.weight`; the encoders' paths are torchvision's names.

mod file;
mod problem;

use std::collections::BTreeMap;

pub use file::{
    FileKind, floats, read_bytes, read_safetensors, read_safetensors_under, write_safetensors,
};
pub use problem::FormatProblem;

/// One tensor's values, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightTensor {
    /// Shape, outermost dimension first.
    pub shape: Vec<usize>,
    /// The values; their number is the product of `shape`.
    pub values: Vec<f32>,
}

/// Tensors by name, and their origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// Name in error messages: the file's path, or a description.
    pub origin: String,
    /// The tensors.
    pub tensors: BTreeMap<String, WeightTensor>,
    /// Free text stored beside the tensors (safetensors' metadata).
    pub metadata: BTreeMap<String, String>,
}

impl Weights {
    /// A set without tensors.
    #[must_use]
    pub fn new(origin: impl Into<String>) -> Self {
        Self {
            origin: origin.into(),
            tensors: BTreeMap::new(),
            metadata: BTreeMap::new(),
        }
    }

    /// The tensors whose names start with `prefix`, which is removed.
    #[must_use]
    pub fn under(&self, prefix: &str) -> Self {
        Self {
            origin: self.origin.clone(),
            tensors: self
                .tensors
                .iter()
                .filter_map(|(name, tensor)| {
                    Some((name.strip_prefix(prefix)?.to_owned(), tensor.clone()))
                })
                .collect(),
            metadata: self.metadata.clone(),
        }
    }

    /// All tensors, with `prefix` added to their names.
    #[must_use]
    pub fn with_prefix(self, prefix: &str) -> Self {
        self.renamed(|name| Some(format!("{prefix}{name}")))
    }

    /// The tensors under the names that `rename` returns; those with `None` are dropped.
    #[must_use]
    pub fn renamed(self, rename: impl Fn(&str) -> Option<String>) -> Self {
        Self {
            tensors: self
                .tensors
                .into_iter()
                .filter_map(|(name, tensor)| Some((rename(&name)?, tensor)))
                .collect(),
            ..self
        }
    }

    /// These tensors and the other's; of two with the same name, the other's.
    #[must_use]
    pub fn merged(mut self, other: Self) -> Self {
        self.tensors.extend(other.tensors);
        self
    }

    /// The name of the first tensor, for messages; empty if there is none.
    #[must_use]
    pub fn first_name(&self) -> &str {
        self.tensors.keys().next().map_or("", String::as_str)
    }

    /// The number of values of all tensors.
    #[must_use]
    pub fn value_count(&self) -> usize {
        self.tensors
            .values()
            .map(|tensor| tensor.values.len())
            .sum()
    }
}
