//! Measured depth: what it means, what moves in it, and images of it.

pub(crate) mod depth_images;
pub(crate) mod measured;
mod moving;
mod scan;

pub use moving::{MovingLabels, MovingPixels, MovingSource};
pub use scan::{DynamicAgreement, GtKind, LidarMotion, ScanTruth};
