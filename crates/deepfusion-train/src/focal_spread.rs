//! How well the drives of a run determine the focal length that it learned.

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_geometry::Se3;
use deepfusion_model::ViewMotion;
use nalgebra::{Matrix3, Vector3};

use crate::{
    BatchLoader, Error, ForwardPass, Model, Motion, SampleSet, Schedule, SnippetBatch, TrainConfig,
};

/// Number of parts of the drives that are evaluated separately.
const BLOCKS: usize = 12;
/// Fewest parts whose disagreement is meaningful.
const LEAST_BLOCKS: usize = 4;
/// Samples taken from each part, spread over it.
const SAMPLES: usize = 3;
/// Step of the finite differences in ln f: warped pixels move by a fraction of a pixel.
const STEP: f64 = 0.05;
/// If the standard deviation of ln f is larger, the drives do not determine f.
const MOST: f64 = 0.5;

/// The standard deviation of ln f; `None` where the loss hardly depends on f.
///
/// With the networks fixed, the loss of each part of the drives is computed at f and 5 % to either side. This gives its slope g_b and
/// curvature H_b. σ² = n/(n − 1) · Σ(g_b − ḡ)²/(ΣH_b)² is the sandwich estimator with each part as a cluster. (Σg/ΣH)² is added, the
/// squared distance of f from its optimum. PoseNet's turns would have adapted to another f. They are therefore divided by it, so that only
/// changes that no turn can imitate count (Gordon et al., arXiv 1904.04998). An error in the scale of measured turns leads to the same
/// error of f; it is not part of σ.
///
/// # Errors
/// [`Error::Data`] where an image cannot be read, [`Error::Loader`].
pub(crate) fn focal_spread(
    model: &Model,
    config: &TrainConfig,
    samples: &SampleSet,
    device: &Device,
) -> Result<Option<f64>, Error> {
    let (model, device) = (model.valid(device), device.clone().inner());
    let config = TrainConfig {
        batch: SAMPLES,
        ..config.clone()
    };
    let loader = BatchLoader::validation(&config, of_blocks(samples));
    let mut blocks = Vec::new();
    while let Some(batch) = loader.next(&device) {
        let batch = model.with_learned_camera(batch?);
        let pass = model.forward(&batch);
        let [below, here, above] =
            [-STEP, 0.0, STEP].map(|step| loss_at(&model, (&batch, &pass), step));
        blocks.push((
            (above - below) / (2.0 * STEP),
            (above - 2.0 * here + below) / (STEP * STEP),
        ));
    }
    Ok(sandwich(&blocks))
}

/// The standard deviation from the parts' slopes and curvatures; `None` if there are too few parts or their sum has no clear minimum.
fn sandwich(blocks: &[(f64, f64)]) -> Option<f64> {
    let n = blocks.len() as f64;
    if blocks.len() < LEAST_BLOCKS {
        return None;
    }
    let slopes: f64 = blocks.iter().map(|(g, _)| g).sum();
    let curvature: f64 = blocks.iter().map(|(_, h)| h).sum();
    let scatter: f64 = blocks.iter().map(|(g, _)| (g - slopes / n).powi(2)).sum();
    let variance = scatter * n / (n - 1.0) + slopes * slopes;
    let sigma = variance.sqrt() / curvature;
    (curvature > 0.0 && sigma < MOST).then_some(sigma)
}

/// A few samples from each of up to [`BLOCKS`] consecutive parts.
fn of_blocks(samples: &SampleSet) -> SampleSet {
    let all = &samples.samples;
    let blocks = BLOCKS.min(all.len() / SAMPLES);
    let chosen = (0..blocks * SAMPLES).map(|i| {
        // The middle of each third of a part.
        let place = (2 * i + 1) * all.len() / (2 * blocks * SAMPLES);
        all[place].clone()
    });
    SampleSet {
        samples: chosen.collect(),
        ..samples.clone()
    }
}

/// The photometric loss at ln f + step, with the networks' outputs unchanged.
fn loss_at(model: &Model, (batch, pass): (&SnippetBatch, &ForwardPass), step: f64) -> f64 {
    let device = batch.intrinsics.device();
    let batch = SnippetBatch {
        // Depth stays the network's: if it followed f, that would reveal nothing about f.
        factors: batch.factors.clone(),
        ..model.refocused(batch, Tensor::from_data([step as f32], &device))
    };
    let times = pass.intrinsics.dims()[0] / batch.len();
    let pass = ForwardPass {
        intrinsics: batch.intrinsics.clone().repeat_dim(0, times),
        inverse_intrinsics: batch.inverse_intrinsics.clone().repeat_dim(0, times),
        motions: match model.config().view_motion {
            ViewMotion::Vehicle => pass.motions.clone(),
            // With `auto`, PoseNet's motions warp only drives whose turns are not known.
            ViewMotion::PoseNet | ViewMotion::Distance | ViewMotion::Auto => {
                let followed = pass.motions.iter().map(|m| following(m, step.exp()));
                followed.collect()
            }
        },
        flows: Vec::new(),
        ..pass.clone()
    };
    let schedule = Schedule {
        speed_weight: 0.0,
        masks_active: false,
    };
    model.loss(&pass, &batch, schedule).terms.reprojection
}

/// The motions that a network would have learned with `ratio` times the focal length: they move the middle of the image in the same way.
fn following(motion: &Motion, ratio: f64) -> Motion {
    let device = motion.rotation.device();
    let read = |data: TensorData| -> Vec<f64> { data.iter::<f64>().collect() };
    let rotations = read(motion.rotation.clone().into_data());
    let translations = read(motion.translation.clone().into_data());
    let mut turned = Vec::with_capacity(rotations.len());
    let mut shifted = Vec::with_capacity(translations.len());
    for (r, t) in rotations.chunks_exact(9).zip(translations.chunks_exact(3)) {
        let turn = Se3::from_parts(&Matrix3::from_row_slice(r), Vector3::zeros()).axis_angle();
        let turn = Vector3::new(turn.x / ratio, turn.y / ratio, turn.z);
        let r = Se3::from_axis_angle(turn, Vector3::zeros()).rotation();
        turned.extend((0..9).map(|i| r[(i / 3, i % 3)] as f32));
        shifted.extend([t[0] / ratio, t[1] / ratio, t[2]].map(|v| v as f32));
    }
    let [n, _] = motion.translation.dims();
    Motion {
        rotation: Tensor::from_data(TensorData::new(turned, [n, 3, 3]), &device),
        translation: Tensor::from_data(TensorData::new(shifted, [n, 3]), &device),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The losses (x − x_b)²/2 have the slope −x_b and the curvature 1 at 0. So the sandwich is the standard error of the mean, and the
    /// mean is the step to the optimum.
    #[test]
    fn the_sandwich_is_the_standard_error_of_a_mean() {
        let x = [0.11, -0.05, 0.02, -0.08, 0.04, -0.04];
        let n = x.len() as f64;
        let mean = x.iter().sum::<f64>() / n;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let expected = (variance / n + mean * mean).sqrt();
        let blocks: Vec<_> = x.iter().map(|x| (-x, 1.0)).collect();
        let found = sandwich(&blocks).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        assert_eq!(sandwich(&blocks[..3]), None, "too few");
        let flat: Vec<_> = x.iter().map(|x| (-x, 0.01)).collect();
        assert_eq!(sandwich(&flat), None);
        let hill: Vec<_> = x.iter().map(|x| (-x, -1.0)).collect();
        assert_eq!(sandwich(&hill), None);
    }

    /// Small turns and shifts move the middle of the image in the same way for both focal lengths.
    #[test]
    fn the_middle_of_the_image_does_not_determine_the_focal_length() {
        let device = Device::flex();
        let motion = Motion::new(
            Tensor::from_data([[0.004_f32, -0.006, 0.003]], &device),
            Tensor::from_data([[0.01_f32, 0.02, 0.5]], &device),
        );
        let seen = |motion: &Motion, focal: f64| {
            let r: Vec<f64> = motion.rotation.clone().into_data().iter().collect();
            let t: Vec<f64> = motion.translation.clone().into_data().iter().collect();
            let depth = 10.0;
            let point = [0, 1, 2].map(|i| depth * r[3 * i + 2] + t[i]);
            [0, 1].map(|i| focal * point[i] / point[2])
        };
        let before = seen(&motion, 200.0);
        let after = seen(&following(&motion, 1.2), 240.0);
        for (before, after) in before.iter().zip(after) {
            assert!((before - after).abs() < 0.01, "{before} {after}");
        }
    }
}
