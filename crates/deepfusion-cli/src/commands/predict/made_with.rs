//! What the outputs of a command depend on, beside the image.

use crate::failure::Result;
use deepfusion_jobs::bulk::CameraSource;
use deepfusion_jobs::outputs::DepthOutputs;
use deepfusion_records::MadeWith;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use crate::cli::PredictionArgs;
use crate::model::ModelFacts;

/// For these arguments and this network.
pub(super) fn made_with(
    args: &PredictionArgs,
    outputs: &DepthOutputs,
    model: &ModelSource,
    estimator: &DepthEstimator,
    camera: &CameraSource,
) -> Result<MadeWith> {
    Ok(MadeWith {
        version: env!("CARGO_PKG_VERSION").into(),
        weights: model.content_sha256(args.engine.precision)?,
        engine: format!("{} on {}", estimator.engine(), args.engine.device),
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
        focal_correction: !args.no_focal_correction,
        stretch: args.stretch,
        correct_scale: args.correct_scale,
        post_process: args.post_process,
        set: args.engine.set.clone(),
    })
}
