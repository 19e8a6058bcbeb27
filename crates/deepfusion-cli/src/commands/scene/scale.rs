//! Whether a recording's metres still are what they were.

use std::fmt::Display;
use std::sync::Arc;

use deepfusion_data::{RgbImage, grey_image};
use deepfusion_geometry::Intrinsics;
use deepfusion_motion::{
    GroundPair, RoadTexture, ScaleCorrection, ScaleMonitor, ScaleMonitorConfig, ScaleReading,
    ScaleState,
};
use deepfusion_perception::Ground;
use deepfusion_video::Address;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::predict::inputs::Input;
use super::Motion;
use super::motion::motion_known;
use crate::cli::PredictionArgs;
use crate::error::CliError;

/// Width of the images that the scale is watched in.
const WIDTH: u32 = 320;

/// What the monitor says of a frame, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// The reading.
    #[serde(flatten)]
    pub reading: ScaleReading,
    /// What the next frame's depth is multiplied by, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<f64>,
}

/// Watches the metres of a recording: [`ScaleMonitor`] over its frames, in their order.
pub struct ScaleWatch {
    config: ScaleMonitorConfig,
    correct: bool,
    /// What was learned of one camera.
    camera: Option<Intrinsics>,
    monitor: ScaleMonitor,
    correction: Option<ScaleCorrection>,
    last: Option<Arc<RoadTexture>>,
    drift_told: bool,
}

impl ScaleWatch {
    /// From the first frame on, as the arguments say.
    pub fn of(args: &PredictionArgs) -> Self {
        let config = args.scale_config();
        Self {
            camera: None,
            monitor: ScaleMonitor::new(config.clone()),
            correction: args.correct_scale.then(ScaleCorrection::default),
            last: None,
            drift_told: false,
            correct: args.correct_scale,
            config,
        }
    }

    /// That the monitor's options are not given where it would never look: they would change nothing, silently.
    ///
    /// # Errors
    /// [`CliError::Unwatched`].
    pub fn check(
        args: &PredictionArgs,
        source: Option<&Address>,
        inputs: &[Input],
    ) -> Result<(), CliError> {
        let option = match args {
            args if args.correct_scale => "--correct-scale",
            args if args.camera_height.is_some() => "--camera-height",
            _ => return Ok(()),
        };
        let unwatched = |input: &dyn Display, why| CliError::Unwatched {
            option,
            input: input.to_string(),
            why,
        };
        if let Some(address) = source {
            return Err(unwatched(address, "a live source tells no motion"));
        }
        for input in inputs {
            match &input.frame {
                None => {
                    let path = input.path.display();
                    return Err(unwatched(&path, "an image stands for itself"));
                }
                Some((dataset, _)) if !motion_known(dataset) => {
                    let name = dataset.name();
                    return Err(unwatched(&name, "its motion is not known"));
                }
                Some(_) => {}
            }
        }
        Ok(())
    }

    /// Begins anew where another camera begins: nothing that was learned of the last one holds for it.
    fn meet(&mut self, camera: &Intrinsics) {
        if self
            .camera
            .replace(*camera)
            .is_some_and(|before| before != *camera)
        {
            self.monitor = ScaleMonitor::new(self.config.clone());
            self.correction = self.correct.then(ScaleCorrection::default);
            self.last = None;
        }
    }

    /// What a frame's depth is to be multiplied by, from what is known before it; `None` where nothing is corrected.
    pub fn correction(&self) -> Option<f64> {
        self.correction.as_ref().map(ScaleCorrection::factor)
    }

    /// Takes the next frame in; `None` where it does not go on from the last one. `ground` is that of the corrected
    /// depth.
    pub fn add(
        &mut self,
        name: &str,
        image: &RgbImage,
        camera: &Intrinsics,
        motion: &Motion,
        ground: Option<&Ground>,
    ) -> Option<Scale> {
        if !motion.goes_on {
            self.monitor.pause();
            self.last = None;
        }
        // A frame that stands for itself moves by nothing that is known.
        motion.stamp?;
        self.meet(camera);
        let width = WIDTH.min(camera.width);
        let height = (width * camera.height).div_ceil(camera.width).max(1);
        let later = Arc::new(RoadTexture::from(&grey_image(image, width, height)));
        let earlier = self.last.replace(later.clone());
        // The mount knows better than a single image's ground where down is.
        let seen = || ground.map(|ground| -Vector3::from(ground.up.map(f64::from)));
        let pair = GroundPair {
            earlier: earlier?,
            later,
            intrinsics: camera.resized(width, height),
            seconds: motion.seconds?,
            earlier_from_later: motion.last_from_this?,
            down_in_cam: motion.down_in_cam.or_else(seen)?,
        };
        let factor = self.correction().unwrap_or(1.0);
        let depth_height_m = ground.map(|ground| f64::from(ground.camera_height_m) / factor);
        let reading = self.monitor.add(&pair, depth_height_m);
        self.tell_drift(name, &reading);
        if let Some(correction) = &mut self.correction {
            correction.follow(&reading);
        }
        Some(Scale {
            reading,
            correction: self.correction(),
        })
    }

    /// Says once that the metres have changed.
    fn tell_drift(&mut self, frame: &str, reading: &ScaleReading) {
        if reading.state == ScaleState::Drift
            && let Some(ratio) = reading.ratio
            && !std::mem::replace(&mut self.drift_told, true)
        {
            tracing::warn!(
                "{frame}: the road says that metres are {ratio:.2} times what they were: were the images zoomed, the camera \
                 moved, or is the speed wrong? (scale_monitor in each frame's JSON; --correct-scale brings depth back)"
            );
        }
    }
}
