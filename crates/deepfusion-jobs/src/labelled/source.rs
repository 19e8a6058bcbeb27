//! The sources of the depth in which targets are found.

use deepfusion_data::{Dataset, RgbImage, kitti::GtKind};
use deepfusion_eval::IntervalFactors;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{Perception, PerceptionConfig, Stamp, Target, working_depth};
use deepfusion_runtime::{DepthEstimator, Preparer};

use super::lidar::gathered;
use super::object_frames::ObjectFrame;
use super::visibility::VisibilityDepth;
use crate::{Result, intervals};

/// A source of depth.
pub enum DepthSource {
    /// The simulator's exact depth.
    Truth,
    /// The scans.
    Lidar,
    /// A network, which predicts every frame: a target needs several frames to be confirmed.
    Network(Box<PredictedDepth>),
}

/// A network with its settings.
pub struct PredictedDepth {
    /// The network.
    pub estimator: DepthEstimator,
    /// Prepares its input: [`DepthEstimator::preparer`], or [`DepthEstimator::augmented`] for several predictions.
    pub preparer: Preparer,
    /// The factors of its intervals.
    pub intervals: IntervalFactors,
}

impl DepthSource {
    /// The word for it in a report: `truth`, `lidar` or `predicted`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Truth => "truth",
            Self::Lidar => "lidar",
            Self::Network(_) => "predicted",
        }
    }

    /// The perception settings for depth of this kind.
    #[must_use]
    pub fn settings(&self) -> PerceptionConfig {
        match self {
            Self::Truth | Self::Lidar => PerceptionConfig::default(),
            Self::Network(_) => PerceptionConfig::predicted(),
        }
    }

    /// The depth of a recording's frame; `None` if it has none.
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

    /// The depth of a labelled frame; it has no exact depth.
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

/// Depth of a frame, with its uncertainty if the source has it.
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

    /// The targets in the frame.
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
