//! Labels of the pixels of a frame's ground truth that belong to dynamic objects, which move over the ground.

use super::scan::GtKind;
use crate::Result;
use deepfusion_geometry::DepthMap;
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Source of the labels of dynamic pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MovingSource {
    /// The simulator's exact masks.
    Masks,
    /// KITTI's tracklets whose boxes move over the ground.
    Tracklets,
    /// Radial velocities of a frequency-modulated LiDAR.
    RadialVelocity,
    /// A topic with the dynamic points of a scan, for a LiDAR without velocities.
    DynamicPoints,
}

/// The dynamic pixels of a recording.
#[derive(Debug, Clone)]
pub struct MovingLabels {
    source: MovingSource,
    moving: Arc<dyn MovingPixels>,
}

/// Finds the dynamic pixels of a frame's ground truth; each source of labels has an implementation.
pub trait MovingPixels: fmt::Debug + Send + Sync {
    /// See [`MovingLabels::pixels`].
    ///
    /// # Errors
    /// If the labels cannot be read, or do not fit the ground truth.
    fn pixels(&self, frame: u64, truth: &DepthMap, kind: GtKind) -> Result<Option<Vec<bool>>>;
}

impl MovingLabels {
    /// Labels from a source.
    #[must_use]
    pub fn new(source: MovingSource, moving: impl MovingPixels + 'static) -> Self {
        Self {
            source,
            moving: Arc::new(moving),
        }
    }

    /// Where the labels come from.
    #[must_use]
    pub fn source(&self) -> MovingSource {
        self.source
    }

    /// Which pixels of a frame's ground truth (at the image's size) move, row by row; `None` for a
    /// frame without a mask. A tracklet's box includes the pixels whose 3D point lies inside it.
    ///
    /// # Errors
    /// Those of [`crate::load_rgb`]; [`crate::Error::Size`] if the mask's size differs from the ground truth's.
    pub fn pixels(&self, frame: u64, truth: &DepthMap, kind: GtKind) -> Result<Option<Vec<bool>>> {
        self.moving.pixels(frame, truth, kind)
    }
}
