//! The focal length of an unknown camera, as a parameter.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::ops::is_cpu;

use crate::{
    AssumedCamera, Error, SampleProblem, SampleSet, SnippetBatch, TrainConfig, TrainWarning,
    ViewMotion,
};

/// The logarithm of the focal length over the assumed one, ln(f/f₀). Both axes share it, since turns to the side do not determine fy. All
/// recordings of a run share it.
#[derive(Module, Debug)]
pub struct LearnedFocal {
    /// ln(f/f₀), one number.
    pub log_ratio: Param<Tensor<1>>,
}

impl LearnedFocal {
    /// The focal length of the assumed camera: ln(f/f₀) = 0.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        Self {
            log_ratio: Param::from_data(TensorData::from([0.0_f32]), device),
        }
    }

    /// Clamps the focal length to the range that `camera` allows. It would drift away where nothing determines it.
    #[must_use]
    pub(crate) fn clamped_to(self, camera: &AssumedCamera) -> Self {
        let (least, most) = camera.ratios();
        if !is_cpu(&self.log_ratio.val().device()) {
            return self.clamped(least, most);
        }
        let bound = self.ratio().clamp(least, most);
        if bound == self.ratio() {
            return self;
        }
        let device = self.log_ratio.val().device();
        Self {
            log_ratio: Param::from_data(TensorData::from([bound.ln() as f32]), &device),
        }
    }

    /// Clamps on the device, so that a step on a GPU does not wait for the number to be read.
    fn clamped(self, least: f64, most: f64) -> Self {
        let (least, most) = (least.ln() as f32, most.ln() as f32);
        let clamp = |log: Tensor<1>| log.inner().clamp(least, most).autodiff().require_grad();
        Self {
            log_ratio: self.log_ratio.map(clamp),
        }
    }

    /// f/f₀.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        f64::from(self.log_ratio.val().into_scalar::<f32>()).exp()
    }
}

/// The batch with another focal length, given by ln(f/f₀), one number. Differentiable: K·diag(r, r, 1) and its inverse. The depths of a
/// network with a `canonical` focal length are scaled to the new one, but without a gradient. Otherwise f would compensate for errors in
/// the network's scale, which the network itself can learn to avoid.
pub(crate) fn refocused(
    batch: &SnippetBatch,
    log_ratio: Tensor<1>,
    canonical: bool,
) -> SnippetBatch {
    let logs = Tensor::cat(
        vec![log_ratio.clone(), log_ratio.clone(), log_ratio.zeros_like()],
        0,
    );
    // A row times K scales its columns, a column times K⁻¹ its rows. The principal point stays the same.
    let columns = logs.clone().exp().reshape([1, 1, 3]);
    let rows = logs.neg().exp().reshape([1, 3, 1]);
    SnippetBatch {
        intrinsics: batch.intrinsics.clone().mul(columns),
        inverse_intrinsics: batch.inverse_intrinsics.clone().mul(rows),
        factors: match &batch.factors {
            Some(factors) if canonical => Some(factors.refocused(log_ratio.detach().exp())),
            factors => factors.clone(),
        },
        ..batch.clone()
    }
}

/// Checks that there is one camera to learn, and no known one.
///
/// # Errors
/// [`Error::CameraKnown`], [`Error::SeveralCameras`].
pub(crate) fn check_camera(config: &TrainConfig, sets: [&SampleSet; 2]) -> Result<(), Error> {
    if config.learned_camera().is_none() {
        return Ok(());
    }
    let mut first: Option<(String, (u32, u32))> = None;
    for samples in sets {
        for sample in &samples.samples {
            let dataset = &samples.datasets[sample.dataset];
            let drive = || dataset.name().to_owned();
            if !dataset.camera_assumed() {
                return Err(Error::CameraKnown { drive: drive() });
            }
            let k = dataset.intrinsics(sample.snippet.target);
            let size = (k.width, k.height);
            let (other, expected) = first.get_or_insert_with(|| (drive(), size));
            if size != *expected {
                return Err(Error::SeveralCameras {
                    drives: [other.clone(), drive()],
                    sizes: [*expected, size],
                });
            }
        }
    }
    if first.is_none() {
        return Err(Error::NoSamples {
            data: "the data to learn a camera from".into(),
            reason: SampleProblem::NoVideo,
        });
    }
    Ok(())
}

/// The focal length is not determined if turns move the network's input by fewer pixels than this, as a mean over pairs.
const LEAST_TURN_PX: f64 = 0.3;

/// The warning before a camera is learned: the vehicle hardly turns, or its measured turns are not used.
pub(crate) fn warning(config: &TrainConfig, samples: &SampleSet) -> Option<TrainWarning> {
    config.learned_camera()?;
    let k = samples.camera()?;
    let (width, height) = (config.size.width as u32, config.size.height as u32);
    let focal_px = k.resized(width, height).fx;
    let sources = samples.samples.iter().flat_map(|s| &s.snippet.sources);
    // Turns are known for all pairs of a drive with a yaw rate, and for none of one without.
    let turns: Vec<f64> = sources
        .filter_map(|s| Some(s.motion.source_from_target?.angle()))
        .collect();
    if turns.is_empty() {
        return Some(TrainWarning::NoMeasuredTurns);
    }
    let mean_rad = turns.iter().sum::<f64>() / turns.len() as f64;
    if mean_rad * focal_px < LEAST_TURN_PX {
        return Some(TrainWarning::HardlyTurns { mean_rad });
    }
    let turns_unused = matches!(
        config.view_motion,
        ViewMotion::PoseNet | ViewMotion::Distance
    );
    turns_unused.then_some(TrainWarning::MeasuredTurnsUnused)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The clamp on a GPU, which does not read the number, gives the same as that on the processor.
    #[test]
    fn both_ways_clamp_the_focal_length_alike() {
        let device = Device::flex().autodiff();
        let camera = AssumedCamera::default();
        let (least, most) = camera.ratios();
        for (log_ratio, expected) in [(-9.0_f32, least), (0.1, 0.1_f64.exp()), (9.0, most)] {
            let focal = || LearnedFocal {
                log_ratio: Param::from_data(TensorData::from([log_ratio]), &device),
            };
            let on_host = focal().clamped_to(&camera).ratio();
            let clamped = focal().clamped(least, most);
            assert!(
                (clamped.ratio() - on_host).abs() < 1e-5 * on_host,
                "{on_host}"
            );
            assert!(
                (on_host - expected).abs() < 1e-5 * on_host,
                "{on_host} {expected}"
            );
            assert!(
                clamped.log_ratio.val().is_require_grad(),
                "it still requires its gradient"
            );
        }
    }
}
