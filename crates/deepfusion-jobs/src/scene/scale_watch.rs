//! Monitors whether the scale of a recording's depth changes.

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

/// Width of the images in which the scale is monitored.
const WIDTH: u32 = 320;

/// Why the scale of an input cannot be monitored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unwatched {
    /// The input is a single image.
    SingleImage,
    /// The recording has no speed or no yaw rate.
    MotionUnknown,
}

impl fmt::Display for Unwatched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SingleImage => "a single image has no motion",
            Self::MotionUnknown => "its motion is unknown",
        })
    }
}

/// The name of the first input whose scale [`ScaleWatch`] cannot monitor, with the reason.
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

/// Monitors the scale of a recording: [`ScaleMonitor`] over its frames in order.
pub struct ScaleWatch {
    config: ScaleMonitorConfig,
    correct: bool,
    /// The camera that the monitor has learned from.
    camera: Option<Intrinsics>,
    monitor: ScaleMonitor,
    correction: Option<ScaleCorrection>,
    last: Option<Arc<RoadTexture>>,
    drifted: bool,
    /// Set until it is read.
    first_drift: Option<f64>,
}

impl ScaleWatch {
    /// Starts at the first frame; with `correct`, it also computes a factor for depth.
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

    /// Starts again if another camera or recording begins: what was learned from the last one does not apply, and a run resumed at the
    /// beginning of a recording gives the same results as one that was never stopped. Call it before the [correction](Self::correction) of
    /// the first frame is read.
    pub fn see_through(&mut self, camera: &Intrinsics, motion: &Motion) {
        let before = self.camera.replace(*camera);
        if motion.begins_recording || before.is_some_and(|before| before != *camera) {
            self.monitor = ScaleMonitor::new(self.config.clone());
            self.correction = self.correct.then(ScaleCorrection::default);
            self.last = None;
            self.drifted = false;
        }
    }

    /// The factor for a frame's depth, known from the frames before; `None` without correction.
    #[must_use]
    pub fn correction(&self) -> Option<f64> {
        self.correction.as_ref().map(ScaleCorrection::factor)
    }

    /// Adds the next frame; `None` if it does not follow the last one. `ground` is the ground found in the corrected depth.
    pub fn add(
        &mut self,
        image: &RgbImage,
        camera: &Intrinsics,
        motion: &Motion,
        ground: Option<&Ground>,
    ) -> Option<ScaleRecord> {
        if !motion.continues {
            self.monitor.pause();
            self.last = None;
        }
        // The motion of a frame that stands alone is unknown.
        motion.stamp?;
        self.see_through(camera, motion);
        let width = WIDTH.min(camera.width);
        let height = (width * camera.height).div_ceil(camera.width).max(1);
        let later = Arc::new(RoadTexture::from(&grey_image(image, width, height)));
        let earlier = self.last.replace(later.clone());
        // The mount gives the downward direction better than the ground of a single image.
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

    /// The factor by which the scale has changed, measured by the road, when this is first found; `None` from then on.
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
    fn the_scale_of_a_recording_does_not_apply_to_the_next() {
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
        // A gap in the recording does not reset it.
        watch.see_through(&camera, &Motion::default());
        assert_eq!(watch.correction(), Some(learned));
        watch.see_through(&camera, &first);
        assert_eq!(watch.correction(), Some(1.0));
        assert!(!watch.drifted);
    }
}
