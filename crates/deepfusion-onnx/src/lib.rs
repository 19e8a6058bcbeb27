//! Depth networks as ONNX files: written, read back, run.
//!
//! [`write()`] turns a [`DepthModel`] into a file that takes an 8-bit picture and gives metres; [`read()`] gets
//! the model back from such a file and from no other. What a file means can be found out in two ways:
//! [`reference`](mod@reference) runs the graph read back, in this program's own operations, and
//! [`runtime`] runs the file itself in an ONNX Runtime library, where the machine has one.

pub mod check;
mod error;
mod model;
mod proto;
mod read;
pub mod reference;
#[cfg(feature = "runtime")]
pub mod runtime;
mod write;

pub use error::Error;
pub use model::{DepthMaps, DepthModel, FocalLength};
pub use read::read;
pub use write::write;

/// The operator set of the files; it has everything that is needed and is older than any library that
/// [`runtime`] opens.
pub const OPSET: i64 = 17;
