//! Whether a recording's metres still are what they were.

use std::fmt;
use std::sync::Arc;

use deepfusion_data::{RgbImage, grey_image};
use deepfusion_geometry::Intrinsics;
use deepfusion_motion::{
    GroundPair, RoadTexture, ScaleCorrection, ScaleMonitor, ScaleMonitorConfig, ScaleReading,
    ScaleState,
};
use deepfusion_perception::Ground;
use deepfusion_records::ScaleRecord;
use nalgebra::Vector3;

use super::{Motion, motion_known};
use crate::Input;

/// Width of the images that the scale is watched in.
const WIDTH: u32 = 320;

/// Why an input's metres cannot be watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unwatched {
    /// It is a single image.
    SingleImage,
    /// The recording does not measure speed and yaw rate.
    MotionUnknown,
}

impl fmt::Display for Unwatched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SingleImage => "an image stands for itself",
            Self::MotionUnknown => "its motion is not known",
        })
    }
}

/// The first input whose metres [`ScaleWatch`] cannot watch, by its name, and why not.
#[must_use]
pub fn unwatched(inputs: &[Input]) -> Option<(String, Unwatched)> {
    inputs.iter().find_map(|input| match &input.frame {
        None => Some((input.path.display().to_string(), Unwatched::SingleImage)),
        Some((dataset, _)) if !motion_known(dataset) => {
            Some((dataset.name().to_owned(), Unwatched::MotionUnknown))
        }
        Some(_) => None,
    })
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
    drifted: bool,
    /// Until somebody asks.
    first_drift: Option<f64>,
}

impl ScaleWatch {
    /// From the first frame on; with `correct` it also says what depth is to be multiplied by.
    #[must_use]
    pub fn new(config: ScaleMonitorConfig, correct: bool) -> Self {
        Self {
            camera: None,
            monitor: ScaleMonitor::new(config.clone()),
            correction: correct.then(ScaleCorrection::default),
            last: None,
            drifted: false,
            first_drift: None,
            correct,
            config,
        }
    }

    /// Begins anew where another camera or recording begins: nothing that was learned of the last one holds for it, and a run that goes on from a
    /// recording's beginning gives what one gives that was never stopped. To be said before the [correction](Self::correction) of its first frame
    /// is asked for.
    pub fn see_through(&mut self, camera: &Intrinsics, motion: &Motion) {
        let before = self.camera.replace(*camera);
        if motion.begins_recording || before.is_some_and(|before| before != *camera) {
            self.monitor = ScaleMonitor::new(self.config.clone());
            self.correction = self.correct.then(ScaleCorrection::default);
            self.last = None;
            self.drifted = false;
        }
    }

    /// What a frame's depth is to be multiplied by, from what is known before it; `None` where nothing is corrected.
    #[must_use]
    pub fn correction(&self) -> Option<f64> {
        self.correction.as_ref().map(ScaleCorrection::factor)
    }

    /// Takes the next frame in; `None` where it does not go on from the last one. `ground` is that of the corrected
    /// depth.
    pub fn add(
        &mut self,
        image: &RgbImage,
        camera: &Intrinsics,
        motion: &Motion,
        ground: Option<&Ground>,
    ) -> Option<ScaleRecord> {
        if !motion.goes_on {
            self.monitor.pause();
            self.last = None;
        }
        // A frame that stands for itself moves by nothing that is known.
        motion.stamp?;
        self.see_through(camera, motion);
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
        self.note_drift(&reading);
        if let Some(correction) = &mut self.correction {
            correction.follow(&reading);
        }
        Some(ScaleRecord {
            reading,
            correction: self.correction(),
        })
    }

    /// By how much the road says that the metres have changed, when that is found for the first time; `None` from then on.
    pub fn first_drift(&mut self) -> Option<f64> {
        self.first_drift.take()
    }

    fn note_drift(&mut self, reading: &ScaleReading) {
        if reading.state == ScaleState::Drift
            && let Some(ratio) = reading.ratio
            && !std::mem::replace(&mut self.drifted, true)
        {
            self.first_drift = Some(ratio);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_learned_of_a_recording_is_not_the_next_ones() {
        let mut watch = ScaleWatch::new(ScaleMonitorConfig::default(), true);
        let camera = Intrinsics::centred(60.0, (96, 64));
        let first = Motion {
            begins_recording: true,
            ..Motion::default()
        };
        watch.see_through(&camera, &first);
        let drift = ScaleReading {
            ratio: Some(1.2),
            ci95: None,
            height_m: None,
            depth_ratio: None,
            state: ScaleState::Drift,
        };
        watch.note_drift(&drift);
        watch.correction.as_mut().unwrap().follow(&drift);
        let learned = watch.correction().unwrap();
        assert!(learned > 1.0, "{learned}");
        // Not even a gap in it takes it away.
        watch.see_through(&camera, &Motion::default());
        assert_eq!(watch.correction(), Some(learned));
        watch.see_through(&camera, &first);
        assert_eq!(watch.correction(), Some(1.0));
        assert!(!watch.drifted);
    }
}
