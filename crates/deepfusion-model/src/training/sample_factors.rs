use deepfusion_geometry::{DepthRange, Intrinsics};

use crate::{InputSize, TrainConfig};

/// How the networks' raw outputs for one sample become metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFactors {
    /// The depths that the sigmoid spans, before `focal` is applied.
    pub range: DepthRange,
    /// Metres of translation per unit of the pose network's output.
    pub metres_per_unit: f64,
    /// Factor of the depth for the sample's camera, f_y/f_c; 1 without a canonical focal length.
    pub focal: f64,
}

impl TrainConfig {
    /// Whether these factors differ between samples.
    #[must_use]
    pub fn has_factors(&self) -> bool {
        !self.data.sets.is_empty() || self.canonical_focal_px.is_some()
    }

    /// The factors for a sample of the data set at an index of `data.sets`, recorded by `camera` (at any size) and input to the networks at
    /// `size`.
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
