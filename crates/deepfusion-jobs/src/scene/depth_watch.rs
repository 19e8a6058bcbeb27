//! Monitors the scale of a recording's depth while it is predicted.

use deepfusion_data::RgbImage;
use deepfusion_geometry::Intrinsics;
use deepfusion_motion::ScaleMonitorConfig;
use deepfusion_perception::{Ground, PerceptionConfig, Rays};
use deepfusion_records::ScaleRecord;
use deepfusion_runtime::Prediction;

use super::{MotionTracker, ScaleWatch};
use crate::Input;

/// Monitors the scale over the frames in order, with the ground found in their depth.
pub struct DepthWatch {
    motions: MotionTracker,
    watch: ScaleWatch,
    config: PerceptionConfig,
    rays: Option<(Intrinsics, Rays)>,
    ground: Option<Ground>,
}

impl DepthWatch {
    /// Starts at the first frame; with `correct`, depth is corrected to the learned scale.
    #[must_use]
    pub fn new(config: ScaleMonitorConfig, correct: bool) -> Self {
        Self {
            motions: MotionTracker::default(),
            watch: ScaleWatch::new(config, correct),
            config: PerceptionConfig::predicted(),
            rays: None,
            ground: None,
        }
    }

    /// Corrects the frame's depth to the learned scale, if requested, and returns the scale's reading; `None` if the camera's motion is
    /// unknown.
    pub fn observe(
        &mut self,
        input: &Input,
        image: &RgbImage,
        camera: Option<Intrinsics>,
        prediction: &mut Prediction,
    ) -> Option<ScaleRecord> {
        let motion = self.motions.next(input);
        if let Some(camera) = &camera {
            self.watch.see_through(camera, &motion);
        }
        if let Some(factor) = self.watch.correction() {
            prediction.scale_depth(factor);
        }
        motion.stamp?;
        let camera = camera?;
        let (depth, k) = prediction.network_depth(&camera);
        if self.rays.as_ref().is_none_or(|(before, _)| *before != k) {
            self.rays = Some((k, Rays::of(&k)));
            self.ground = None;
        }
        let (_, rays) = self.rays.as_ref()?;
        // The last ground is only a guess for this frame if the camera's motion continues.
        let before = self.ground.take().filter(|_| motion.continues);
        self.ground = Ground::find(&depth.data, rays, before.as_ref(), &self.config);
        let ground = self.ground.as_ref();
        self.watch.add(image, &camera, &motion, ground)
    }

    /// As [`ScaleWatch::first_drift`].
    pub fn first_drift(&mut self) -> Option<f64> {
        self.watch.first_drift()
    }
}
