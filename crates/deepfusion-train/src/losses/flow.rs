use super::mean::mean_where;
use crate::FlowLossConfig;
use burn::tensor::{Bool, Device, Tensor};
use deepfusion_nn::ops;

/// The pixels' own coordinates, u then v.
///
/// # Shapes
/// - output: `[1, 2, height, width]`
pub(super) fn pixel_grid([height, width]: [usize; 2], device: &Device) -> Tensor<4> {
    ops::flow_coords(Tensor::zeros(
        [1, 2, height, width],
        &device.clone().inner(),
    ))
}

/// A source seen from the targets by an optical flow.
#[derive(Debug, Clone)]
pub struct FlowView {
    /// Photometric error of the source at the flow's end against the target, N×1×H×W.
    pub error: Tensor<4>,
    /// Where the flow ends, p + f(p), N×2×H×W, in pixels.
    pub coords: Tensor<4>,
    /// f(p) + f'(p + f(p)), N×2×H×W, in pixels: zero where flow and reversed flow agree.
    pub round_trip: Tensor<4>,
    /// Where the flow ends in view and the reversed flow leads back: ‖f + f'‖² < 0.01·(‖f‖² + ‖f'‖²) + 0.5. In an image where fewer than
    /// half of the pixels are led back, every pixel whose flow ends in view: there the flow is wrong, not the pixels occluded. N×1×H×W,
    /// without gradient.
    pub visible: Tensor<4, Bool>,
}

/// Share of an image's pixels in view that must be led back for the rest to count as occluded. Without this limit, two flows that
/// contradict each other everywhere would have no visible pixel and never learn.
const LEAST_CONSISTENT: f64 = 0.5;

/// Warps a source to the targets by the flow between them.
///
/// # Shapes
/// - `target`, `source`: `[N, C, H, W]`
/// - `flow`: `[N, 2, H, W]`, pixels of the target to those of the source
/// - `back`: `[N, 2, H, W]`, pixels of the source to those of the target
#[must_use]
pub fn flow_view(
    target: &Tensor<4>,
    source: &Tensor<4>,
    flow: &Tensor<4>,
    back: &Tensor<4>,
    ssim_weight: f64,
) -> FlowView {
    let [_, _, height, width] = flow.dims();
    let coords = ops::flow_coords(flow.clone());
    let image = ops::warp(source.clone(), coords.clone());
    let returning = ops::warp(back.clone(), coords.clone());
    let in_view = ops::in_view(coords.clone(), [height, width]);
    FlowView {
        error: ops::photometric_error(image, target.clone(), ssim_weight),
        coords,
        round_trip: flow.clone() + returning.clone(),
        visible: visible(flow, &returning, &in_view),
    }
}

/// The pixels in view that are not occluded: forward and backward flow agree, ‖f + f'‖² < 0.01·(‖f‖² + ‖f'‖²) + 0.5. In an image where
/// fewer than half of the pixels are led back, all pixels in view. No gradient.
///
/// # Shapes
/// - `flow`: f, `[N, 2, H, W]`, pixels of one frame to those of the other
/// - `returning`: f', the way back, read where f ends, `[N, 2, H, W]`
/// - `in_view`, output: `[N, 1, H, W]`
#[must_use]
pub fn visible(
    flow: &Tensor<4>,
    returning: &Tensor<4>,
    in_view: &Tensor<4, Bool>,
) -> Tensor<4, Bool> {
    let square = |t: Tensor<4>| t.detach().powi_scalar(2).sum_dim(1);
    let allowed = (square(flow.clone()) + square(returning.clone()))
        .mul_scalar(0.01)
        .add_scalar(0.5);
    let round_trip = flow.clone() + returning.clone();
    let back_again = square(round_trip).lower(allowed).bool_and(in_view.clone());
    let wrong = contradictory(&back_again, in_view);
    in_view.clone().bool_and(back_again.bool_or(wrong))
}

/// The images in which too few of the pixels in view are led back, N×1×1×1 expanded to the masks' size.
fn contradictory(back_again: &Tensor<4, Bool>, in_view: &Tensor<4, Bool>) -> Tensor<4, Bool> {
    let count = |mask: &Tensor<4, Bool>| mask.clone().float().sum_dim(2).sum_dim(3);
    let few = count(back_again).lower(count(in_view).mul_scalar(LEAST_CONSISTENT));
    few.expand(in_view.dims())
}

/// L_f + L_b + w_c·L_c (Eq. 16–20) and the smoothness, of a flow in both directions. The images of both directions have the same weight:
/// L_f + L_b is twice the mean error, L_c the mean over both.
///
/// # Shapes
/// - `views`: the flow's and the reversed flow's, N and N, or one view with both along the batch
/// - `flows`, `images`: of each view, `[N, 2, H, W]` and `[N, C, H, W]`
/// - output: one value
///
/// # Panics
/// Without a view.
#[must_use]
pub fn flow(
    views: &[FlowView],
    flows: &[Tensor<4>],
    images: &[Tensor<4>],
    settings: &FlowLossConfig,
) -> Tensor<1> {
    let count = views.len() as f64;
    let of_view = |view: &FlowView| {
        let photometric = mean_where(view.error.clone(), &view.visible).mul_scalar(2.0);
        // The mean over u and v is half of the L1 norm.
        let round_trip = mean_where(view.round_trip.clone().abs(), &view.visible);
        photometric + round_trip.mul_scalar(2.0 * settings.consistency)
    };
    let terms = views.iter().map(of_view);
    let mut loss = sum(terms).mul_scalar(1.0 / count);
    if settings.smoothness > 0.0 {
        let rough = flows.iter().zip(images).map(|(f, i)| flow_smoothness(f, i));
        loss = loss + sum(rough).mul_scalar(settings.smoothness / count);
    }
    loss
}

#[expect(clippy::expect_used, reason = "documented where it is called")]
fn sum(terms: impl Iterator<Item = Tensor<1>>) -> Tensor<1> {
    terms
        .reduce(|a, b| a + b)
        .expect("a flow has at least one view")
}

/// Weight of image edges, e^(−10·|∂I|), as is common for flow networks.
const EDGE_SHARPNESS: f64 = 10.0;

/// Edge-aware smoothness of a flow, of second order, since a plane's flow is linear:
/// mean(|∂ₓ²f|·e^(−10|∂ₓI|)) + mean(|∂ᵧ²f|·e^(−10|∂ᵧI|)), in pixels, |∂I| the larger of both steps and
/// averaged over channels.
///
/// # Shapes
/// - `flow`: `[N, 2, H, W]`, H and W at least 3
/// - `image`: `[N, C, H, W]`
/// - output: one value
fn flow_smoothness(flow: &Tensor<4>, image: &Tensor<4>) -> Tensor<1> {
    let along = |axis: usize| {
        let difference = |t: Tensor<4>| {
            let size = t.dims()[axis];
            t.clone().narrow(axis, 1, size - 1) - t.narrow(axis, 0, size - 1)
        };
        let bend = difference(difference(flow.clone())).abs();
        let step = difference(image.clone()).abs().mean_dim(1).detach();
        let size = step.dims()[axis];
        let edge = step
            .clone()
            .narrow(axis, 1, size - 1)
            .max_pair(step.narrow(axis, 0, size - 1));
        bend.mul(edge.mul_scalar(-EDGE_SHARPNESS).exp()).mean()
    };
    along(3) + along(2)
}
