//! Writes, reads back and runs depth networks as ONNX files.
//!
//! [`write()`] turns a [`DepthModel`] into a file whose input is an 8-bit picture and whose output is metres;
//! [`read()`] gets the model back from such a file, and refuses any other. A file can be checked in two ways:
//! [`reference`](mod@reference) runs the graph that was read, in this program's own operations, and [`runtime`]
//! runs the file itself in an ONNX Runtime library, if the machine has one.

pub mod check;
mod error;
mod model;
mod problem;
mod proto;
mod read;
pub mod reference;
#[cfg(feature = "runtime")]
pub mod runtime;
mod write;

pub use error::Error;
pub use model::{DepthMaps, DepthModel, FocalLength};
pub use problem::{FormatVersion, LibraryProblem, ModelProblem, NodeProblem, OperatorSet};
pub use read::read;
pub use write::write;

/// The operator set of the files. It has every operator needed, and every library that [`runtime`]
/// opens supports it.
pub const OPSET: i64 = 17;
