use deepfusion_geometry::{DepthRange, Intrinsics};

use crate::{InputSize, TrainConfig};

/// What the networks' raw outputs mean of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFactors {
    /// The depths that the sigmoid spans, before `focal`.
    pub range: DepthRange,
    /// Metres of translation per unit of the pose network's output.
    pub metres_per_unit: f64,
    /// What depth is multiplied by for the sample's camera, f_y/f_c; 1 without a canonical focal length.
    pub focal: f64,
}

impl TrainConfig {
    /// Whether the networks' outputs mean something else from sample to sample.
    #[must_use]
    pub fn has_factors(&self) -> bool {
        !self.data.sets.is_empty() || self.canonical_focal_px.is_some()
    }

    /// What the outputs mean of a sample of a set, by its place in `data.sets`, seen by `camera` (at any size) and shown to
    /// the networks at `size`.
    #[must_use]
    pub fn sample_factors(
        &self,
        set: usize,
        camera: &Intrinsics,
        size: InputSize,
    ) -> SampleFactors {
        let (range, metres_per_unit) = self.factors(set);
        let (width, height) = (size.width as u32, size.height as u32);
        let fy = camera.resized(width, height).fy;
        SampleFactors {
            range,
            metres_per_unit,
            focal: self
                .canonical_focal_px
                .map_or(1.0, |canonical| fy / canonical),
        }
    }
}
