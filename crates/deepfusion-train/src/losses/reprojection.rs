use crate::Synthesised;
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::ops;

/// One source of the targets, warped and as it is.
#[derive(Debug, Clone)]
pub struct View {
    /// The source seen from the target's place.
    pub synthesised: Synthesised,
    /// pe(unwarped source, target), N×1×H×W, without gradient: what standing still would explain.
    pub unwarped_error: Tensor<4>,
}

/// The reprojection loss and what it saw.
#[derive(Debug, Clone)]
pub struct ReprojectionOutput {
    /// The loss, one value.
    pub loss: Tensor<1>,
    /// Each pixel's error, N×1×H×W.
    pub error: Tensor<4>,
    /// Where a warped source explains the pixel best, N×1×H×W.
    pub explained: Tensor<4, Bool>,
    /// Where some source has the pixel in view, N×1×H×W.
    pub valid: Tensor<4, Bool>,
}

/// L_rp of one scale: the mean over **all** pixels of the smallest error among the views.
///
/// A pixel's warped error counts where it is in view; the unwarped error, a constant, stands in where
/// it is not, and competes everywhere with `automask`. The denominator never shrinks, so that
/// throwing pixels out of view does not pay.
///
/// # Shapes
/// - `target`: `[N, C, H, W]`
///
/// # Panics
/// Without a view.
#[must_use]
pub fn reprojection(
    target: &Tensor<4>,
    views: Vec<View>,
    ssim_weight: f64,
    automask: bool,
) -> ReprojectionOutput {
    let mut merged: Option<ReprojectionOutput> = None;
    for view in views {
        let valid = view.synthesised.valid;
        let warped = ops::photometric_error(view.synthesised.image, target.clone(), ssim_weight);
        let constant = view.unwarped_error.detach();
        let explained = if automask {
            let better = warped.clone().detach().lower(constant.clone());
            valid.clone().bool_and(better)
        } else {
            valid.clone()
        };
        let error = constant.mask_where(explained.clone(), warped);
        merged = Some(match merged {
            None => ReprojectionOutput {
                loss: error.clone().mean(),
                error,
                explained,
                valid,
            },
            Some(best) => {
                let smaller = error.clone().detach().lower(best.error.clone().detach());
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

    fn view(image: Tensor<4>, unwarped: Tensor<4>, valid: bool) -> View {
        let [n, _, h, w] = image.dims();
        let ones = Tensor::<4>::ones([n, 1, h, w], &image.device());
        View {
            synthesised: Synthesised {
                image,
                valid: ones.greater_elem(if valid { 0.0 } else { 2.0 }),
            },
            unwarped_error: unwarped,
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
        let out = reprojection(
            &target,
            vec![view(image.clone(), constant, false)],
            0.85,
            false,
        );
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
        let still = vec![view(other.clone(), none.clone(), true)];
        let masked = reprojection(&target, still.clone(), 0.85, true);
        assert_eq!(number(masked.loss), 0.0);
        assert!(number(reprojection(&target, still, 0.85, false).loss) > 0.1);
        // With two views the better one counts at every pixel.
        let large = Tensor::<4>::ones([2, 1, 8, 8], &device);
        let views = vec![
            view(other, large.clone(), true),
            view(target.clone(), large, true),
        ];
        assert!(number(reprojection(&target, views, 0.85, true).loss) < 1e-6);
    }
}
