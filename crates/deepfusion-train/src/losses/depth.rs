//! Learning from known depth (docs/concepts/learning-from-depth.md): error of log depth, and of its differences between neighbours.

use super::mean::mean_over;
use crate::DepthLossConfig;
use burn::tensor::Tensor;

/// Distances in pixels at which the error's differences are compared, at the finest scale (MiDaS's term, on log depth).
const STEPS: [usize; 3] = [1, 2, 4];

/// Ground-truth depth of a batch, pixel by pixel.
#[derive(Debug, Clone)]
pub struct DepthTruth {
    /// ln D, D in metres; where `far` is 1, ln of the least depth that the pixel has; any finite number where neither mask is 1.
    pub log_depth: Tensor<4>,
    /// 1 where the depth is known, else 0.
    pub known: Tensor<4>,
    /// 1 where the depth is only known to be at least `log_depth`: in the sky and beyond the range.
    pub far: Tensor<4>,
}

/// The loss, and its two parts unweighted.
#[derive(Debug, Clone)]
pub struct DepthLoss {
    /// L_depth.
    pub loss: Tensor<1>,
    /// Mean |e| at the finest scale.
    pub error: Tensor<1>,
    /// Σ_k mean(|∂ₓᵏe| + |∂ᵧᵏe|) there.
    pub gradient: Tensor<1>,
    /// Mean of e over the pixels of known depth: ln of predicted over true depth.
    pub bias: Tensor<1>,
}

/// e = ln D̂ − ln D where depth is known; min(e, 0) where only its least value is known; 0 elsewhere.
///
/// # Shapes
/// - `metric_disparity`, output and the truth: B×1×H×W; disparity in 1/m
#[must_use]
pub fn log_depth_error(metric_disparity: Tensor<4>, truth: &DepthTruth) -> Tensor<4> {
    let error = (metric_disparity.log() + truth.log_depth.clone()).neg();
    let too_near = error.clone().neg().clamp_min(0.0).neg();
    error * truth.known.clone() + too_near * truth.far.clone()
}

/// L_depth = Σ_s w_s·mean |e_s| + λ_g·Σ_k mean(|∂ₓᵏe₀| + |∂ᵧᵏe₀|), k = 1, 2, 4; w_0 = 1, w_s = 1/(4s). Means are over the
/// pixels, and the pairs of pixels, of each image whose depth is known or known to be far, then over the images; without any the loss is 0.
///
/// # Shapes
/// - `metric_disparities`: the scales, finest first, each enlarged to B×1×H×W, in 1/m
#[must_use]
pub fn depth(
    metric_disparities: &[Tensor<4>],
    truth: &DepthTruth,
    config: &DepthLossConfig,
) -> DepthLoss {
    let valid = truth.known.clone() + truth.far.clone();
    let finest = log_depth_error(metric_disparities[0].clone(), truth);
    let error = mean_over(finest.clone().abs(), valid.clone());
    // NaN where no depth is known, since then the scale is not known.
    let known = truth.known.clone();
    let bias = (finest.clone().detach() * known.clone()).sum() / known.sum();
    let gradient = STEPS
        .into_iter()
        .flat_map(|step| [(2, step), (3, step)])
        .filter(|(axis, step)| finest.dims()[*axis] > *step)
        .map(|(axis, step)| difference(&finest, &valid, axis, step))
        .reduce(|a, b| a + b)
        .unwrap_or_else(|| error.zeros_like());
    let mut loss = error.clone() + gradient.clone().mul_scalar(config.gradient);
    for (scale, metric_disparity) in metric_disparities.iter().enumerate().skip(1) {
        let coarse = log_depth_error(metric_disparity.clone(), truth).abs();
        let weight = 1.0 / (4.0 * scale as f64);
        loss = loss + mean_over(coarse, valid.clone()).mul_scalar(weight);
    }
    DepthLoss {
        loss,
        error,
        gradient,
        bias,
    }
}

/// Mean |e(p + step) − e(p)| along an axis, over the pairs of two valid pixels.
fn difference(error: &Tensor<4>, valid: &Tensor<4>, axis: usize, step: usize) -> Tensor<1> {
    let length = error.dims()[axis] - step;
    let pair = |x: &Tensor<4>| {
        let ahead = x.clone().narrow(axis, step, length);
        (ahead, x.clone().narrow(axis, 0, length))
    };
    let ((ahead, here), (also, counts)) = (pair(error), pair(valid));
    let both = also * counts;
    mean_over((ahead - here).abs() * both.clone(), both)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    const SIZE: [usize; 4] = [1, 1, 3, 6];

    fn tensor(values: &[f32], device: &Device) -> Tensor<4> {
        Tensor::from_data(TensorData::new(values.to_vec(), SIZE), device)
    }

    /// Depths of 5 to 20 m, a row of them unknown, sky in a corner.
    fn truth(device: &Device) -> DepthTruth {
        let depth = |i: usize| match i {
            0 | 1 => 80.0_f32,
            _ => 5.0 + ((i * 7) % 16) as f32,
        };
        let log_depth: Vec<f32> = (0..18).map(|i| depth(i).ln()).collect();
        let far: Vec<f32> = (0..18).map(|i| f32::from(i < 2)).collect();
        let known: Vec<f32> = (0..18)
            .map(|i| f32::from(i >= 2 && !(12..16).contains(&i)))
            .collect();
        DepthTruth {
            log_depth: tensor(&log_depth, device),
            known: tensor(&known, device),
            far: tensor(&far, device),
        }
    }

    fn config() -> DepthLossConfig {
        DepthLossConfig {
            weight: 1.0,
            gradient: 0.5,
        }
    }

    fn number(x: &Tensor<1>) -> f32 {
        x.clone().into_scalar::<f32>()
    }

    #[test]
    fn the_truth_costs_nothing_and_a_factor_its_logarithm() {
        let device = Device::flex();
        let truth = truth(&device);
        let exact = truth.log_depth.clone().neg().exp();
        let at = |factor: f64| depth(&[exact.clone().div_scalar(factor)], &truth, &config());
        assert!(number(&at(1.0).loss).abs() < 1e-6);
        // Twelve pixels are known; two are far, and already predicted far enough.
        let farther = at(2.0);
        assert!((number(&farther.error) - 12.0 / 14.0 * 2.0_f32.ln()).abs() < 1e-5);
        assert!((number(&farther.bias) - 2.0_f32.ln()).abs() < 1e-5);
        let nearer = at(0.5);
        assert!((number(&nearer.error) - 2.0_f32.ln()).abs() < 1e-5);
        assert!(
            number(&nearer.gradient).abs() < 1e-5,
            "the same error everywhere"
        );
    }

    #[test]
    fn unknown_depth_is_ignored_and_without_known_depth_the_loss_is_zero() {
        let device = Device::flex();
        let truth = truth(&device);
        let mut values = vec![0.1_f32; 18];
        let before = number(&depth(&[tensor(&values, &device)], &truth, &config()).loss);
        values[13] = 7.0;
        let after = number(&depth(&[tensor(&values, &device)], &truth, &config()).loss);
        assert_eq!(before, after);
        let nothing = DepthTruth {
            known: truth.known.zeros_like(),
            far: truth.far.zeros_like(),
            ..truth
        };
        let loss = depth(&[tensor(&values, &device)], &nothing, &config());
        assert_eq!(number(&loss.loss), 0.0);
    }

    #[test]
    fn a_blurred_edge_costs_more_than_a_shifted_plane_of_the_same_error() {
        let device = Device::flex();
        let row = [5.0_f32, 5.0, 5.0, 20.0, 20.0, 20.0];
        let log: Vec<f32> = row.repeat(3).iter().map(|d| d.ln()).collect();
        let ones = Tensor::<4>::ones(SIZE, &device);
        let truth = DepthTruth {
            log_depth: tensor(&log, &device),
            known: ones.clone(),
            far: ones.zeros_like(),
        };
        let half = 0.5 * (20.0_f32 / 5.0).ln();
        let shifts = [0.0, 0.0, half, -half, 0.0, 0.0];
        let blurred: Vec<f32> = (0..18).map(|i| (-log[i] - shifts[i % 6]).exp()).collect();
        let even: Vec<f32> = log.iter().map(|l| (-l - half / 3.0).exp()).collect();
        let loss = |values: &[f32]| depth(&[tensor(values, &device)], &truth, &config());
        let (blurred, even) = (loss(&blurred), loss(&even));
        assert!((number(&blurred.error) - number(&even.error)).abs() < 1e-5);
        assert!(number(&blurred.loss) > 2.0 * number(&even.loss));
    }

    /// Errors are at least 0.05 apart from each other and from 0 here, so that steps of 1e-3 cross no kink of |·|. f32
    /// central differences of a loss of order 1 are good to about 1e-3.
    #[test]
    fn gradient_equals_finite_differences() {
        let device = Device::flex().autodiff();
        let truth = truth(&device);
        let logs: Vec<f32> = truth.log_depth.clone().into_data().iter().collect();
        let point: Vec<f32> = (0..18)
            .map(|i| (-logs[i] + 0.07 * ((i * 5) % 18) as f32 - 0.61).exp())
            .collect();
        let loss = |values: &[f32]| {
            let x = Tensor::<1>::from_data(values, &device).require_grad();
            let finest = x.clone().reshape(SIZE);
            let coarse = finest.clone().mul_scalar(1.13);
            let loss = depth(&[finest, coarse], &truth, &config()).loss;
            (x, loss)
        };
        let (x, value) = loss(&point);
        let gradient = x.grad(&value.backward()).unwrap().into_data();
        for (i, exact) in gradient.iter::<f32>().enumerate() {
            // A relative step, since the loss depends on the value's logarithm.
            let step = 1e-3 * point[i];
            let at = |step: f32| {
                let mut moved = point.clone();
                moved[i] += step;
                loss(&moved).1.into_scalar::<f32>()
            };
            let numeric = (at(step) - at(-step)) / (2.0 * step);
            assert!(
                (numeric - exact).abs() * point[i] < 1e-3,
                "{i}: {numeric} {exact}"
            );
        }
    }
}
