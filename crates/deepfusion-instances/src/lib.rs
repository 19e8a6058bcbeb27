//! Instances in an image, each with its pixels, from a third-party segmentation or detection model in ONNX. An ONNX Runtime library runs
//! it.
//!
//! The steps for an image: [`Letterbox`] fits it into the model's input. [`Layout`] recognises the kind of model from the outputs' shapes.
//! [`decode`] turns outputs into candidates, and [`suppress`] applies non-maximum suppression. [`Prototypes`] turn coefficients into masks.
//! [`InstanceModel`] does all of this.
//!
//! Pixels are those of the given image: x to the right, y down, pixel centres at whole numbers plus one half, as is usual for detectors.

mod candidate;
mod decode;
mod error;
mod layout;
mod letterbox;
mod mask;
mod model;
mod names;

pub use deepfusion_fs::FileError;

pub use candidate::{Candidate, suppress};
pub use decode::decode;
pub use error::{Error, Result};
pub use layout::{Kind, Layout, ShapeProblem};
pub use letterbox::{Colours, Letterbox};
pub use mask::{Mask, Prototypes, in_size};
pub use model::{Instance, InstanceModel, Limits};
