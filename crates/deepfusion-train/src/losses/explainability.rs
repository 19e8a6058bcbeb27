//! The loss of SfMLearner (Zhou et al., CVPR 2017, Sec. 3.3): every source counts, weighted by how well the pose network expects it to
//! explain the pixel.

use burn::tensor::activation::log_sigmoid;
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::ops::sigmoid;

use super::{ReprojectionOutput, View};

/// L_rp of one scale: the mean over all pixels **and** views of E·pe. Where a view does not see a pixel, or the pixel is dynamic, its
/// unwarped error is used, a constant.
///
/// # Shapes
/// - `logits`: ln(E / (1 − E)) by view, N×1×H×W; empty: E = 1
///
/// # Panics
/// If there are no views.
#[must_use]
#[expect(
    clippy::expect_used,
    reason = "documented, and a validated configuration has a source"
)]
pub fn mean_reprojection(views: Vec<View>, logits: &[Tensor<4>]) -> ReprojectionOutput {
    let share = 1.0 / views.len() as f64;
    let of_view = |(index, view): (usize, View)| {
        let mut explained = view.valid.clone();
        if let Some(moving) = view.moving {
            explained = explained.bool_and(moving.bool_not());
        }
        let constant = view.unwarped_error.detach();
        let mut error = constant.mask_where(explained.clone(), view.error);
        if let Some(logit) = logits.get(index) {
            explained = explained.bool_and(logit.clone().greater_elem(0.0));
            error = error.mul(sigmoid(logit.clone()));
        }
        (error, explained, view.valid)
    };
    let either = |a: Tensor<4, Bool>, b| a.bool_or(b);
    let (error, explained, valid) = views
        .into_iter()
        .enumerate()
        .map(of_view)
        .reduce(|a, b| (a.0 + b.0, either(a.1, b.1), either(a.2, b.2)))
        .expect("a target has at least one source: the configuration is validated");
    let error = error.mul_scalar(share);
    ReprojectionOutput {
        loss: error.clone().mean(),
        error,
        explained,
        valid,
    }
}

/// L_e: the mean over pixels and views of −ln E, which keeps E from becoming 0 everywhere.
///
/// # Shapes
/// - `logits`: ln(E / (1 − E)) by view, N×1×H×W
///
/// # Panics
/// If there are no views.
#[must_use]
pub fn explainability(logits: &[Tensor<4>]) -> Tensor<1> {
    log_sigmoid(Tensor::cat(logits.to_vec(), 0)).mean().neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    fn number(tensor: Tensor<1>) -> f32 {
        tensor.into_scalar::<f32>()
    }

    /// Three pixels and two sources, by hand.
    #[test]
    fn every_source_is_weighted_by_its_mask() {
        let device = Device::flex();
        let row = |values: [f32; 3]| Tensor::<4>::from_data([[[values]]], &device);
        let view = |error, seen, constant| View {
            error: row(error),
            valid: row(seen).greater_elem(0.5),
            unwarped_error: row(constant),
            moving: None,
        };
        let views = vec![
            view([0.4, 0.8, 0.2], [1.0, 0.0, 1.0], [0.1, 0.6, 0.1]),
            view([0.2, 0.6, 0.4], [1.0, 0.0, 0.0], [0.1, 0.2, 0.8]),
        ];
        let read = |t: Tensor<4>| -> Vec<f32> { t.into_data().iter().collect() };
        let close = |found: Vec<f32>, expected: [f32; 3]| {
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f32::max) < 1e-6, "{found:?} for {expected:?}");
        };
        let plain = mean_reprojection(views.clone(), &[]);
        close(read(plain.error), [0.3, 0.4, 0.5]);
        assert!((number(plain.loss) - 0.4).abs() < 1e-6);
        // E of 3/4 and 1/4.
        let three = 3.0_f32.ln();
        let logits = [row([three; 3]), row([-three; 3])];
        let masked = mean_reprojection(views, &logits);
        close(read(masked.error), [0.175, 0.25, 0.175]);
        close(read(masked.explained.float()), [1.0, 0.0, 1.0]);
        close(read(masked.valid.float()), [1.0, 0.0, 1.0]);
        let expected = -(0.75_f32.ln() + 0.25_f32.ln()) / 2.0;
        assert!((number(explainability(&logits)) - expected).abs() < 1e-6);
        // A mask of almost 0 still has a gradient that raises it.
        let far = [row([-200.0; 3])];
        assert!((number(explainability(&far)) - 200.0).abs() < 1e-3);
    }

    /// Both terms are smooth in the logits; in f32 a step of 1e-2 leaves 1e-4.
    #[test]
    fn gradients_equal_finite_differences() {
        let device = Device::flex().autodiff();
        let wave = |seed: usize| {
            let values = (0..48).map(|i| ((i * i * seed + i) as f64).sin() as f32);
            let values: Vec<f32> = values.collect();
            Tensor::<1>::from_data(values.as_slice(), &device).reshape([1, 1, 6, 8])
        };
        let (errors, seen) = ([wave(1).abs(), wave(2).abs()], wave(3).greater_elem(-0.5));
        let other = wave(4);
        let loss = |logit: Tensor<4>| {
            let views = errors.clone().map(|error| View {
                error,
                valid: seen.clone(),
                unwarped_error: Tensor::full([1, 1, 6, 8], 0.3, &device),
                moving: None,
            });
            let logits = [logit, other.clone()];
            let seen = mean_reprojection(views.to_vec(), &logits).loss;
            seen + explainability(&logits).mul_scalar(0.2)
        };
        let point = wave(5).require_grad();
        let gradient = point.grad(&loss(point.clone()).backward()).unwrap();
        for direction in (6..=8).map(wave) {
            let ours = number(gradient.clone().mul(direction.clone().inner()).sum());
            let at = |step: f64| {
                let moved = point.clone().detach() + direction.clone().mul_scalar(step);
                number(loss(moved))
            };
            let numeric = (at(1e-2) - at(-1e-2)) / 2e-2;
            let tolerance = 1e-2 * ours.abs() + 1e-4;
            assert!(
                (numeric - ours).abs() < tolerance,
                "{ours} instead of {numeric}"
            );
        }
    }
}
