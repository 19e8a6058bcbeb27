//! Which pixels of a frame's ground truth belong to dynamic objects, which move over the ground.

use super::scan::GtKind;
use crate::Result;
use deepfusion_geometry::DepthMap;
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Where moving labels come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MovingSource {
    /// The simulator's exact masks.
    Masks,
    /// KITTI's tracklets, moving where their box moves over the ground.
    Tracklets,
    /// Radial velocities of a frequency-modulated LiDAR.
    RadialVelocity,
    /// A topic with the points of a scan that move, beside a LiDAR without velocities.
    DynamicPoints,
}

/// The dynamic pixels of a recording.
#[derive(Debug, Clone)]
pub struct MovingLabels {
    source: MovingSource,
    moving: Arc<dyn MovingPixels>,
}

/// Finds the dynamic pixels of a frame's ground truth; one implementation a source of labels.
pub trait MovingPixels: fmt::Debug + Send + Sync {
    /// As [`MovingLabels::pixels`].
    ///
    /// # Errors
    /// Where the labels cannot be read, or do not fit the ground truth.
    fn pixels(&self, frame: u64, truth: &DepthMap, kind: GtKind) -> Result<Option<Vec<bool>>>;
}

impl MovingLabels {
    /// Labels of a source.
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
    /// frame without a mask. A tracklet's box takes the pixels whose point in space lies inside it.
    ///
    /// # Errors
    /// As [`crate::load_rgb`]; [`crate::Error::Size`] where the mask has another size than the ground truth.
    pub fn pixels(&self, frame: u64, truth: &DepthMap, kind: GtKind) -> Result<Option<Vec<bool>>> {
        self.moving.pixels(frame, truth, kind)
    }
}
