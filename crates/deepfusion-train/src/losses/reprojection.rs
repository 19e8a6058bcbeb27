use burn::tensor::{Bool, Tensor};

/// One source of the targets: the errors of its warped and its unwarped image.
#[derive(Debug, Clone)]
pub struct View {
    /// pe(warped source, target), N×1×H×W.
    pub error: Tensor<4>,
    /// Where the pixel is in view of the source, N×1×H×W.
    pub valid: Tensor<4, Bool>,
    /// pe(unwarped source, target), N×1×H×W, without gradient: the automask's baseline.
    pub unwarped_error: Tensor<4>,
    /// Where the pixel is dynamic, N×1×H×W: the warp must not explain it.
    pub moving: Option<Tensor<4, Bool>>,
}

/// More than any photometric error, which is at most 1.
const NO_ERROR: f64 = 10.0;

impl View {
    /// A view that only some samples have (`there`, N, 1 or 0). In the others it sees no pixel, and its constant is larger than any error,
    /// so that it is never the smallest.
    ///
    /// Each sample must have at least one other view.
    #[must_use]
    pub fn only_where(self, there: &Tensor<1>) -> Self {
        let [n] = there.dims();
        let there = there.clone().reshape([n, 1, 1, 1]);
        let constant = there.clone().neg().add_scalar(1.0).mul_scalar(NO_ERROR);
        let seen = there.greater_elem(0.5).expand(self.valid.dims());
        Self {
            valid: self.valid.bool_and(seen),
            unwarped_error: self.unwarped_error.add(constant),
            ..self
        }
    }
}

/// The reprojection loss and its per-pixel results.
#[derive(Debug, Clone)]
pub struct ReprojectionOutput {
    /// The loss, one value.
    pub loss: Tensor<1>,
    /// Each pixel's error, N×1×H×W.
    pub error: Tensor<4>,
    /// Where a warped source explains the pixel best, N×1×H×W.
    pub explained: Tensor<4, Bool>,
    /// Where at least one source has the pixel in view, N×1×H×W.
    pub valid: Tensor<4, Bool>,
}

/// L_rp of one scale: the mean over **all** pixels of the smallest error among the views.
///
/// A view contributes a pixel's warped error where it sees the pixel, and its unwarped error, a constant, where the pixel is dynamic. With
/// `automask` the unwarped errors of all views compete at every pixel. Without it a view that does not see a pixel does not take part in
/// the minimum there; where no view sees it, the smallest of their constants is used. The denominator never shrinks, so that moving pixels
/// out of view does not lower the loss.
///
/// # Panics
/// If there are no views.
#[must_use]
#[expect(
    clippy::expect_used,
    reason = "documented, and a validated configuration has a source"
)]
pub fn reprojection(views: Vec<View>, automask: bool) -> ReprojectionOutput {
    let mut merged: Option<ReprojectionOutput> = None;
    for view in views {
        let (valid, warped) = (view.valid, view.error);
        let constant = view.unwarped_error.detach();
        let mut explained = valid.clone();
        if automask {
            let better = warped.clone().detach().lower(constant.clone());
            explained = explained.bool_and(better);
        }
        if let Some(moving) = view.moving {
            explained = explained.bool_and(moving.bool_not());
        }
        let error = constant.mask_where(explained.clone(), warped);
        merged = Some(match merged {
            None => ReprojectionOutput {
                loss: error.clone().mean(),
                error,
                explained,
                valid,
            },
            Some(best) => {
                let mut smaller = error.clone().detach().lower(best.error.clone().detach());
                if !automask {
                    let only = valid.clone().bool_and(best.valid.clone().bool_not());
                    let beaten = best.valid.clone().bool_and(valid.clone().bool_not());
                    smaller = smaller.bool_or(only).bool_and(beaten.bool_not());
                }
                let error = best.error.mask_where(smaller.clone(), error);
                let explained = best
                    .explained
                    .bool_and(smaller.clone().bool_not())
                    .bool_or(explained.bool_and(smaller));
                ReprojectionOutput {
                    loss: error.clone().mean(),
                    error,
                    explained,
                    valid: best.valid.bool_or(valid),
                }
            }
        });
    }
    merged.expect("a target has at least one source: the configuration is validated")
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, Distribution};
    use deepfusion_nn::ops;

    fn view(target: &Tensor<4>, image: Tensor<4>, unwarped: Tensor<4>, valid: bool) -> View {
        let [n, _, h, w] = image.dims();
        let ones = Tensor::<4>::ones([n, 1, h, w], &image.device());
        View {
            error: ops::photometric_error(image, target.clone(), 0.85),
            valid: ones.greater_elem(if valid { 0.0 } else { 2.0 }),
            unwarped_error: unwarped,
            moving: None,
        }
    }

    fn number(tensor: Tensor<1>) -> f32 {
        tensor.into_scalar::<f32>()
    }

    #[test]
    fn out_of_view_pixels_cost_the_constant_and_give_no_gradient() {
        let device = Device::flex().autodiff();
        let target = Tensor::<4>::random([1, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device);
        let image = Tensor::<4>::random([1, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device)
            .require_grad();
        let constant = Tensor::<4>::full([1, 1, 8, 8], 0.25, &device);
        let out = reprojection(vec![view(&target, image.clone(), constant, false)], false);
        assert!((number(out.loss.clone()) - 0.25).abs() < 1e-6);
        let gradients = out.loss.backward();
        if let Some(gradient) = image.grad(&gradients) {
            assert_eq!(number(gradient.abs().max()), 0.0);
        }
    }

    #[test]
    fn the_mask_keeps_what_standing_still_explains() {
        let device = Device::flex();
        let target = Tensor::<4>::random([2, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device);
        let other = Tensor::<4>::random([2, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device);
        let none = Tensor::<4>::zeros([2, 1, 8, 8], &device);
        let still = vec![view(&target, other.clone(), none.clone(), true)];
        let masked = reprojection(still.clone(), true);
        assert_eq!(number(masked.loss), 0.0);
        assert!(number(reprojection(still, false).loss) > 0.1);
        // With two views the better one counts at every pixel.
        let large = Tensor::<4>::ones([2, 1, 8, 8], &device);
        let views = vec![
            view(&target, other, large.clone(), true),
            view(&target, target.clone(), large, true),
        ];
        assert!(number(reprojection(views, true).loss) < 1e-6);
    }

    /// Four pixels and two sources, by hand. Seen by both: the smaller warped error, 0.4. Seen by the first alone: its 0.9, though the
    /// other's constant is 0.1. Seen by the second alone: 0.8. Seen by none: the smaller constant, 0.2.
    #[test]
    fn a_source_that_does_not_see_a_pixel_is_ignored_there() {
        let device = Device::flex().autodiff();
        let row = |values: [f32; 4]| Tensor::<4>::from_data([[[values]]], &device);
        let errors = [[0.4, 0.9, 0.3, 0.3], [0.5, 0.3, 0.8, 0.3]].map(|e| row(e).require_grad());
        let seen = [[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0]];
        let constants = [[0.1, 0.1, 0.1, 0.6], [0.1, 0.1, 0.1, 0.2]];
        for order in [[0, 1], [1, 0]] {
            let views = order.map(|i: usize| View {
                error: errors[i].clone(),
                valid: row(seen[i]).greater_elem(0.5),
                unwarped_error: row(constants[i]),
                moving: None,
            });
            let out = reprojection(views.clone().to_vec(), false);
            let read = |t: Tensor<4>| -> Vec<f32> { t.into_data().iter().collect() };
            assert_eq!(read(out.error), [0.4, 0.9, 0.8, 0.2]);
            assert_eq!(read(out.explained.float()), [1.0, 1.0, 1.0, 0.0]);
            assert_eq!(read(out.valid.float()), [1.0, 1.0, 1.0, 0.0]);
            // The mean is over all four pixels, whichever source sees them.
            assert!((number(out.loss.clone()) - 2.3 / 4.0).abs() < 1e-6);
            let gradients = out.loss.backward();
            let [first, second] = [0, 1].map(|i: usize| read(errors[i].grad(&gradients).unwrap()));
            assert_eq!(first, [0.25, 0.25, 0.0, 0.0]);
            assert_eq!(second, [0.0, 0.0, 0.25, 0.0]);
            // Every constant competes with automask: standing still explains all but the last pixel best.
            let masked = reprojection(views.to_vec(), true);
            assert_eq!(read(masked.error), [0.1, 0.1, 0.1, 0.2]);
        }
    }

    /// Of two samples the second lacks the better view: its loss is that of the first view alone, and only the first view has a gradient.
    #[test]
    fn a_missing_view_is_never_the_minimum() {
        let device = Device::flex().autodiff();
        let rows = |a: f32, b: f32| Tensor::<4>::from_data([[[[a]]], [[[b]]]], &device);
        let (in_time, beside) = (rows(0.4, 0.4).require_grad(), rows(0.1, 0.0).require_grad());
        let view = |error: &Tensor<4>, constant: [f32; 2]| View {
            error: error.clone(),
            valid: error.ones_like().greater_elem(0.5),
            unwarped_error: rows(constant[0], constant[1]),
            moving: None,
        };
        for automask in [false, true] {
            let there = Tensor::<1>::from_data([1.0, 0.0], &device);
            // The target in its place has no error.
            let other = view(&beside, [0.9, 0.0]).only_where(&there);
            for views in [
                vec![view(&in_time, [0.8, 0.8]), other.clone()],
                vec![other.clone(), view(&in_time, [0.8, 0.8])],
            ] {
                let out = reprojection(views, automask);
                let read = |t: Tensor<4>| -> Vec<f32> { t.into_data().iter().collect() };
                assert_eq!(read(out.error), [0.1, 0.4]);
                assert_eq!(read(out.valid.float()), [1.0, 1.0]);
                assert_eq!(read(out.explained.float()), [1.0, 1.0]);
                let gradients = out.loss.backward();
                assert_eq!(read(in_time.grad(&gradients).unwrap()), [0.0, 0.5]);
                assert_eq!(read(beside.grad(&gradients).unwrap()), [0.5, 0.0]);
            }
        }
    }

    /// Two sources, each seeing its part of an image. Values are away from kinks; in f32 a step of 1e-2 on a
    /// smooth function of order 1 leaves 1e-4.
    #[test]
    fn the_gradient_of_several_sources_equals_finite_differences() {
        let device = Device::flex().autodiff();
        let wave = |seed: usize| {
            let values = (0..3 * 6 * 8).map(|i| ((i * i * seed + i) as f64).sin() as f32);
            let values: Vec<f32> = values.collect();
            Tensor::<1>::from_data(values.as_slice(), &device).reshape([1, 3, 6, 8])
        };
        let image = |seed| wave(seed).mul_scalar(0.5).add_scalar(0.5);
        let (target, images) = (image(4), [image(5), image(6)]);
        let column = Tensor::<1>::from_data([0., 1., 2., 3., 4., 5., 6., 7.], &device);
        let column = column.reshape([1, 1, 1, 8]).expand([1, 1, 6, 8]);
        let sight = [column.clone().lower_elem(5.5), column.greater_elem(2.5)];
        let loss = |first: Tensor<4>| {
            let constant = Tensor::<4>::full([1, 1, 6, 8], 0.01, &device);
            let images = [first, images[1].clone()];
            let views = images
                .into_iter()
                .zip(sight.clone())
                .map(|(image, valid)| View {
                    valid,
                    ..view(&target, image, constant.clone(), true)
                });
            reprojection(views.collect(), false).loss
        };
        let point = images[0].clone().require_grad();
        let gradient = point.grad(&loss(point.clone()).backward()).unwrap();
        for direction in (1..=3).map(wave) {
            let ours = number(gradient.clone().mul(direction.clone().inner()).sum());
            let at = |step: f64| {
                let moved = point.clone().detach() + direction.clone().mul_scalar(step);
                number(loss(moved))
            };
            let numeric = (at(1e-3) - at(-1e-3)) / 2e-3;
            let tolerance = 2e-2 * ours.abs() + 1e-3;
            assert!(
                (numeric - ours).abs() < tolerance,
                "{ours} instead of {numeric}"
            );
        }
    }

    #[test]
    fn dynamic_pixels_cost_the_constant_and_give_no_gradient() {
        let device = Device::flex().autodiff();
        let target = Tensor::<4>::random([1, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device);
        let image = Tensor::<4>::random([1, 3, 8, 8], Distribution::Uniform(0.0, 1.0), &device)
            .require_grad();
        let constant = Tensor::<4>::full([1, 1, 8, 8], 0.9, &device);
        let mut left = view(&target, image.clone(), constant, true);
        // The left half is dynamic; SSIM's windows reach one column beyond the border.
        let column = Tensor::<1>::from_data([0., 1., 2., 3., 4., 5., 6., 7.], &device);
        let moving = column.lower_elem(4.0).reshape([1, 1, 1, 8]);
        left.moving = Some(moving.expand([1, 1, 8, 8]));
        let out = reprojection(vec![left], false);
        let of = |t: &Tensor<4>, first, count| t.clone().narrow(3, first, count).mean();
        assert!((number(of(&out.error, 0, 4)) - 0.9).abs() < 1e-6);
        assert!(number(of(&out.error, 4, 4)) < 0.7);
        let gradient = image.grad(&out.loss.backward()).unwrap();
        assert_eq!(number(of(&gradient.clone().abs(), 0, 3)), 0.0);
        assert!(number(of(&gradient.abs(), 4, 4)) > 0.0);
    }
}
