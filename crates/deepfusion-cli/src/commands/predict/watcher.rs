//! The watch over a recording's metres while it is predicted.

use deepfusion_geometry::Intrinsics;
use deepfusion_perception::{Ground, PerceptionConfig, Rays};
use deepfusion_runtime::Prediction;

use super::super::scene::{MotionTracker, Scale, ScaleWatch};
use super::Loaded;
use super::inputs::Input;
use crate::cli::PredictionArgs;

/// Follows the frames in their order.
pub struct Watcher {
    motions: MotionTracker,
    watch: ScaleWatch,
    config: PerceptionConfig,
    rays: Option<(Intrinsics, Rays)>,
    ground: Option<Ground>,
}

impl Watcher {
    /// From the first frame on.
    pub fn of(args: &PredictionArgs) -> Self {
        Self {
            motions: MotionTracker::default(),
            watch: ScaleWatch::of(args),
            config: PerceptionConfig::predicted(),
            rays: None,
            ground: None,
        }
    }

    /// Brings the frame's depth back to the metres that were learned, where that was asked for, and tells whether they
    /// hold; `None` where nothing is known of how the camera moved.
    pub fn look(
        &mut self,
        input: &Input,
        loaded: &Loaded,
        prediction: &mut Prediction,
    ) -> Option<Scale> {
        let motion = self.motions.next(input);
        if let Some(factor) = self.watch.correction() {
            prediction.scale_depth(factor);
        }
        motion.stamp?;
        let camera = loaded.camera?;
        let (depth, k) = prediction.network_depth(&camera);
        if self.rays.as_ref().is_none_or(|(before, _)| *before != k) {
            self.rays = Some((k, Rays::of(&k)));
            self.ground = None;
        }
        let (_, rays) = self.rays.as_ref()?;
        // The last ground is a guess for this one only while the camera goes on.
        let before = self.ground.take().filter(|_| motion.goes_on);
        self.ground = Ground::find(&depth.data, rays, before.as_ref(), &self.config);
        let ground = self.ground.as_ref();
        self.watch
            .add(&input.name, &loaded.image, &camera, &motion, ground)
    }
}
