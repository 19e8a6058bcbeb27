//! How images become depth, and on which of these settings the outputs depend.

use deepfusion_data::NamedTopic;
use deepfusion_eval::PostProcess;
use deepfusion_motion::ScaleMonitorConfig;
use deepfusion_records::MadeWith;
use deepfusion_runtime::{DepthEstimator, ModelSource, Precision};

use super::{CameraSource, GivenCamera, ImageLoader};
use crate::evaluation::augmentation;
use crate::outputs::DepthOutputs;
use crate::{ModelFacts, Result};

/// How images become depth.
#[derive(Debug, Clone)]
pub struct DepthSettings {
    /// The camera of inputs without a camera of their own.
    pub camera: Option<GivenCamera>,
    /// Whether depth is corrected for a focal length other than the one trained with.
    pub focal_correction: bool,
    /// Whether images of another aspect ratio are stretched rather than cropped.
    pub stretch: bool,
    /// Of which predictions of an image the mean is taken (test-time augmentation); `None`: only one prediction.
    pub post_process: Option<PostProcess>,
    /// How the scale is monitored if a recording's motion is known.
    pub scale: ScaleMonitorConfig,
    /// Whether depth is corrected if its scale has drifted.
    pub correct_scale: bool,
    /// The training data set whose metric scale is used, if there were several.
    pub set: Option<String>,
    /// The topics chosen for bags.
    pub topics: Vec<NamedTopic>,
    /// The precision in which the network computes.
    pub precision: Precision,
    /// Name of the device.
    pub device: String,
}

impl DepthSettings {
    /// The loader that reads the images.
    ///
    /// # Errors
    /// A camera's file that cannot be read; several input sizes for a network that takes one.
    pub(super) fn loader(&self, estimator: &DepthEstimator) -> Result<ImageLoader> {
        let trained = estimator.training_camera();
        let camera_learned = estimator.config().learned_camera().is_some();
        Ok(ImageLoader {
            camera: CameraSource::chosen(self.camera.as_ref(), trained, camera_learned)?,
            camera_learned,
            preparer: estimator.augmented(augmentation(self.post_process))?,
            focal_correction: self.focal_correction,
            crop: !self.stretch,
        })
    }

    /// What the outputs depend on besides the image.
    ///
    /// # Errors
    /// Weights that cannot be read.
    pub(super) fn made_with(
        &self,
        outputs: &DepthOutputs,
        model: &ModelSource,
        estimator: &DepthEstimator,
        camera: &CameraSource,
    ) -> Result<MadeWith> {
        Ok(MadeWith {
            version: env!("CARGO_PKG_VERSION").into(),
            weights: model.content_sha256(self.precision)?,
            engine: format!("{} on {}", estimator.engine(), self.device),
            save: outputs.save().iter().map(|s| s.name().to_owned()).collect(),
            max_depth_m: outputs.limits.max_depth_m,
            max_sigma: outputs.limits.max_sigma,
            intrinsics: match camera {
                CameraSource::Given(k) => Some(*k),
                CameraSource::File(k) => Some([k.fx, k.fy, k.cx, k.cy]),
                CameraSource::Hfov(_)
                | CameraSource::Lens(_)
                | CameraSource::Trained(_)
                | CameraSource::Learned(_)
                | CameraSource::Unknown => None,
            },
            hfov_deg: match camera {
                CameraSource::Hfov(degrees) => Some(*degrees),
                _ => None,
            },
            calibration_sha256: match camera {
                CameraSource::Lens(file) => Some(file.sha256.clone()),
                _ => None,
            },
            focal_correction: self.focal_correction,
            stretch: self.stretch,
            correct_scale: self.correct_scale,
            post_process: self.post_process,
            set: self.set.clone(),
            topics: self.topics.iter().map(ToString::to_string).collect(),
            camera_height_m: self.scale.height_m.filter(|_| self.correct_scale),
        })
    }
}
