//! Measured depth: what it means, which pixels are dynamic, and images of it.

pub(crate) mod depth_images;
pub(crate) mod measured;
mod moving;
mod overlay;
mod scan;

pub use moving::{MovingLabels, MovingPixels, MovingSource};
pub use overlay::overlay;
pub use scan::{DynamicAgreement, GtKind, LidarMotion, NoSuchDepth, ScanTruth};
