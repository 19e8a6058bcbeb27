//! Learning the uncertainty of depth (docs/concepts/learning-from-depth.md): the negative log-likelihood of its error under a
//! Laplace distribution.

use super::DepthTruth;
use super::depth::log_depth_error;
use super::mean::mean_over;
use burn::tensor::Tensor;
use deepfusion_model::LOG_SCALE_BOUNDS;

/// L_nll = mean(|e|/b + ln b) over the pixels of known depth of each image, then over the images, e = ln D̂ − ln D. It is smallest where b
/// is the expected error.
/// No gradient reaches the depth: e counts as a constant.
///
/// # Shapes
/// - `metric_disparity` (1/m), `log_scale` (ln b) and the truth: B×1×H×W
#[must_use]
pub fn uncertainty(
    metric_disparity: Tensor<4>,
    log_scale: Tensor<4>,
    truth: &DepthTruth,
) -> Tensor<1> {
    let known = truth.known.clone();
    let error = log_depth_error(metric_disparity.detach(), truth).abs();
    let log_scale = log_scale.clamp(LOG_SCALE_BOUNDS.0, LOG_SCALE_BOUNDS.1);
    let each = error * log_scale.clone().neg().exp() + log_scale;
    mean_over(each * known.clone(), known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    const SIZE: [usize; 4] = [1, 1, 2, 3];

    fn tensor(values: [f32; 6], device: &Device) -> Tensor<4> {
        Tensor::from_data(TensorData::new(values.to_vec(), SIZE), device)
    }

    /// Depths of 10 m, except for a pixel of unknown depth and one of the sky.
    fn truth(device: &Device) -> DepthTruth {
        DepthTruth {
            log_depth: tensor([10.0_f32.ln(); 6], device),
            known: tensor([1.0, 1.0, 1.0, 1.0, 0.0, 0.0], device),
            far: tensor([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], device),
        }
    }

    /// Errors of 0.1, 0.2, 0.4 and 0.8 in ln depth, and other errors where depth is not known.
    fn seen(device: &Device) -> Tensor<4> {
        let error = [0.1_f32, -0.2, 0.4, -0.8, 3.0, -3.0];
        tensor(error.map(|e| (-e).exp() / 10.0), device)
    }

    fn number(x: &Tensor<1>) -> f32 {
        x.clone().into_scalar::<f32>()
    }

    #[test]
    fn the_loss_is_smallest_where_b_is_the_error() {
        let device = Device::flex();
        let (truth, seen) = (truth(&device), seen(&device));
        let right = [0.1_f32, 0.2, 0.4, 0.8, 1.0, 1.0].map(f32::ln);
        let least = number(&uncertainty(seen.clone(), tensor(right, &device), &truth));
        // 1 + mean(ln b) there.
        let expected = 1.0 + right[..4].iter().sum::<f32>() / 4.0;
        assert!((least - expected).abs() < 1e-5, "{least} {expected}");
        for pixel in 0..4 {
            for off in [-0.5, 0.5] {
                let mut other = right;
                other[pixel] += off;
                let more = number(&uncertainty(seen.clone(), tensor(other, &device), &truth));
                assert!(more > least + 0.01, "{pixel} {off}: {more} {least}");
            }
        }
        // Where depth is not known, b has no effect.
        let mut other = right;
        (other[4], other[5]) = (1.7, -2.0);
        let same = number(&uncertainty(seen, tensor(other, &device), &truth));
        assert_eq!(same, least);
    }

    /// The loss is smooth in ln b: central differences of 1e-2 in f32 are good to about 1e-3.
    #[test]
    fn gradient_equals_finite_differences_and_depth_has_none() {
        let device = Device::flex().autodiff();
        let truth = truth(&device);
        let point = [-1.0_f32, -2.0, -1.5, -0.3, 0.5, 0.1];
        let loss = |values: [f32; 6]| {
            let log_scale = tensor(values, &device).require_grad();
            let depth = seen(&device).require_grad();
            let loss = uncertainty(depth.clone(), log_scale.clone(), &truth);
            (log_scale, depth, loss)
        };
        let (log_scale, depth, value) = loss(point);
        let gradients = value.backward();
        assert!(depth.grad(&gradients).is_none(), "depth is a constant here");
        let exact: Vec<f32> = log_scale
            .grad(&gradients)
            .unwrap()
            .into_data()
            .iter()
            .collect();
        for (i, exact) in exact.into_iter().enumerate() {
            let at = |step: f32| {
                let mut moved = point;
                moved[i] += step;
                number(&loss(moved).2)
            };
            let numeric = (at(1e-2) - at(-1e-2)) / 2e-2;
            assert!((numeric - exact).abs() < 1e-3, "{i}: {numeric} {exact}");
        }
    }
}
