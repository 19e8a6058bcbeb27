//! Third-party models: any names and shapes, numbers in f32.

use std::path::Path;

use ort::session::Session;
use ort::value::{TensorElementType, TensorRef};

use super::{Library, refused, session};
use crate::{Error, ModelProblem};

/// A model's description of an input or an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorInfo {
    /// Its name.
    pub name: String,
    /// Its dimensions; `None` for one that the model does not fix.
    pub shape: Vec<Option<usize>>,
    /// Whether its numbers are 32-bit floats.
    pub f32: bool,
}

/// An output: its dimensions and its numbers, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tensor {
    /// Dimensions.
    pub shape: Vec<usize>,
    /// The numbers, as many as the product of the dimensions.
    pub data: Vec<f32>,
}

/// A third-party model in ONNX Runtime, with one input.
#[derive(Debug)]
pub struct ForeignModel {
    session: Session,
    library: Library,
}

impl ForeignModel {
    /// Loads a file; `library` and `threads` as for [`super::OrtEngine::load`].
    ///
    /// # Errors
    /// As [`super::find`]; [`Error::Library`] if this process already uses another library, [`Error::Runtime`]
    /// for a model that the library does not accept.
    pub fn load(library: Option<&Path>, model: &[u8], threads: usize) -> Result<Self, Error> {
        let (session, library) = session(library, model, threads)?;
        Ok(Self { session, library })
    }

    /// Path of the library it runs in.
    #[must_use]
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// Descriptions of its inputs.
    #[must_use]
    pub fn inputs(&self) -> Vec<TensorInfo> {
        self.session.inputs().iter().map(info).collect()
    }

    /// Descriptions of its outputs.
    #[must_use]
    pub fn outputs(&self) -> Vec<TensorInfo> {
        self.session.outputs().iter().map(info).collect()
    }

    /// The metadata stored in it under a key.
    #[must_use]
    pub fn note(&self, key: &str) -> Option<String> {
        self.session.metadata().ok()?.custom(key)
    }

    /// All outputs for its one input, in the order of [`Self::outputs`].
    ///
    /// # Shapes
    /// - `data`: as many numbers as `shape`'s product, row by row
    ///
    /// # Errors
    /// [`Error::Model`] for a model with several inputs, or with outputs that are not f32; [`Error::Runtime`].
    pub fn run(&mut self, shape: &[usize], data: &[f32]) -> Result<Vec<Tensor>, Error> {
        const RUN: &str = "run the model";
        let names: Vec<&str> = self.session.inputs().iter().map(|i| i.name()).collect();
        let &[name] = &names[..] else {
            return Err(Error::Model {
                part: "inputs",
                reason: ModelProblem::Inputs { found: names.len() },
            });
        };
        let name = name.to_owned();
        let input = TensorRef::from_array_view((shape, data)).map_err(|e| refused(RUN, e))?;
        let outputs = self
            .session
            .run(ort::inputs![name => input])
            .map_err(|e| refused(RUN, e))?;
        let tensor = |(_, value): (&str, ort::value::ValueRef<'_>)| {
            let values = value.try_extract_tensor::<f32>();
            let (shape, values) = values.map_err(|e| refused("return its output", e))?;
            Ok(Tensor {
                shape: shape.iter().map(|d| (*d).max(0) as usize).collect(),
                data: values.to_vec(),
            })
        };
        outputs.iter().map(tensor).collect()
    }
}

fn info(outlet: &ort::value::Outlet) -> TensorInfo {
    let shape = outlet.dtype().tensor_shape();
    TensorInfo {
        name: outlet.name().to_owned(),
        shape: shape
            .map(|s| s.iter().map(|d| usize::try_from(*d).ok()).collect())
            .unwrap_or_default(),
        f32: outlet.dtype().tensor_type() == Some(TensorElementType::Float32),
    }
}
