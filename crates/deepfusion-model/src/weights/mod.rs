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
    /// Extents, outermost first.
    pub shape: Vec<usize>,
    /// As many values as the extents' product.
    pub values: Vec<f32>,
}

/// Tensors by name, and where they come from.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// What error messages call them: the file's path, or a description.
    pub origin: String,
    /// The tensors.
    pub tensors: BTreeMap<String, WeightTensor>,
    /// Free text stored beside the tensors (safetensors' metadata).
    pub metadata: BTreeMap<String, String>,
}

impl Weights {
    /// No tensors yet.
    #[must_use]
    pub fn new(origin: impl Into<String>) -> Self {
        Self {
            origin: origin.into(),
            tensors: BTreeMap::new(),
            metadata: BTreeMap::new(),
        }
    }

    /// The tensors whose names start with `prefix`, without it.
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

    /// All tensors, `prefix` before their names.
    #[must_use]
    pub fn with_prefix(self, prefix: &str) -> Self {
        self.renamed(|name| Some(format!("{prefix}{name}")))
    }

    /// The tensors under the names that `rename` gives them; those it gives none are dropped.
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

    /// These and the other's tensors, the other's where both have one.
    #[must_use]
    pub fn merged(mut self, other: Self) -> Self {
        self.tensors.extend(other.tensors);
        self
    }

    /// The name of the first tensor, for messages; empty without any.
    #[must_use]
    pub fn first_name(&self) -> &str {
        self.tensors.keys().next().map_or("", String::as_str)
    }

    /// How many values all tensors hold.
    #[must_use]
    pub fn value_count(&self) -> usize {
        self.tensors
            .values()
            .map(|tensor| tensor.values.len())
            .sum()
    }
}
