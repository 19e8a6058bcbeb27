//! Where the depth comes from that targets are found in.

use deepfusion_data::{Dataset, RgbImage, kitti::GtKind};
use deepfusion_eval::IntervalFactors;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{Perception, PerceptionConfig, Stamp, Target, working_depth};
use deepfusion_runtime::{DepthEstimator, Preparer};

use super::lidar::gathered;
use super::object_frames::ObjectFrame;
use super::visibility::VisibilityDepth;
use crate::{Result, intervals};

/// Where the measured depth comes from.
pub enum DepthSource {
    /// The simulator's exact depth.
    Truth,
    /// The scans.
    Lidar,
    /// A network, of every frame: targets need more than one to be confirmed.
    Network(Box<PredictedDepth>),
}

/// A network, and what is made of what it says.
pub struct PredictedDepth {
    /// The network.
    pub estimator: DepthEstimator,
    /// How its input is made: of [`DepthEstimator::preparer`], or of [`DepthEstimator::augmented`] for several predictions.
    pub preparer: Preparer,
    /// What its intervals are stretched by.
    pub intervals: IntervalFactors,
}

impl DepthSource {
    /// One word for a report: `truth`, `lidar` or `predicted`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Truth => "truth",
            Self::Lidar => "lidar",
            Self::Network(_) => "predicted",
        }
    }

    /// How depth of this kind is looked at.
    #[must_use]
    pub fn settings(&self) -> PerceptionConfig {
        match self {
            Self::Truth | Self::Lidar => PerceptionConfig::default(),
            Self::Network(_) => PerceptionConfig::predicted(),
        }
    }

    /// What is seen of a recording's frame; `None` where it is not measured.
    pub(super) fn of_frame(
        &mut self,
        dataset: &Dataset,
        index: usize,
        visibility: Option<&VisibilityDepth>,
    ) -> Result<Option<FrameDepth>> {
        let camera = dataset.intrinsics(index);
        Ok(match self {
            Self::Truth => visibility
                .filter(|visibility| visibility.dense)
                .map(|visibility| FrameDepth::exact(working_depth(&visibility.depth, &camera))),
            Self::Lidar => dataset
                .ground_truth(index, GtKind::Z)?
                .map(|scan| FrameDepth::exact(gathered(&scan, &camera))),
            Self::Network(network) => Some(network.measured(&dataset.load_image(index)?, &camera)?),
        })
    }

    /// What is seen of a labelled frame; it has no exact depth.
    pub(super) fn of_object_frame(&mut self, frame: &ObjectFrame) -> Result<Option<FrameDepth>> {
        Ok(match self {
            Self::Truth => None,
            Self::Lidar => Some(FrameDepth::exact(gathered(&frame.scan, &frame.camera))),
            Self::Network(network) => {
                let image = deepfusion_data::load_rgb(&frame.image)?;
                Some(network.measured(&image, &frame.camera)?)
            }
        })
    }
}

impl PredictedDepth {
    fn measured(&mut self, image: &RgbImage, camera: &Intrinsics) -> Result<FrameDepth> {
        let prepared = self.preparer.prepare(image, Some(camera), true, true);
        let prediction = self.estimator.infer(&prepared)?;
        let whole = prediction.depth();
        let sigma = intervals::sigma(&prediction, &whole, &self.intervals);
        let (depth, camera_of_depth) = working_depth(&whole, camera);
        Ok(FrameDepth {
            depth,
            sigma: sigma.map(|sigma| working_depth(&sigma, camera).0),
            camera: camera_of_depth,
        })
    }
}

/// Depth of a frame, and what it is worth where its source says so.
pub(super) struct FrameDepth {
    depth: DepthMap,
    sigma: Option<DepthMap>,
    camera: Intrinsics,
}

impl FrameDepth {
    fn exact((depth, camera): (DepthMap, Intrinsics)) -> Self {
        Self {
            depth,
            sigma: None,
            camera,
        }
    }

    /// What stands there.
    pub(super) fn targets(
        &self,
        perception: &mut Perception,
        stamp: Option<Stamp>,
    ) -> Result<Vec<Target>> {
        let sigma = self.sigma.as_ref();
        let seen = perception.detect_with_sigma(&self.depth, sigma, &self.camera, stamp, &[])?;
        Ok(seen.targets)
    }
}
