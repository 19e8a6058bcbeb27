//! Measured depth: its kinds, its dynamic pixels, and pictures of it.

pub(crate) mod depth_images;
pub(crate) mod measured;
mod moving;
mod overlay;
mod scan;

pub use moving::{MovingLabels, MovingPixels, MovingSource};
pub use overlay::overlay;
pub use scan::{DynamicAgreement, GtKind, LidarMotion, NoSuchDepth, ScanTruth};
