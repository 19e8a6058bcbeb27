use super::flow::{FlowView, pixel_grid};
use crate::MovingConfig;
use crate::pose::cross_matrix;
use crate::{Motion, Synthesised};
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::ops;

/// A target's rigid view, by depth and camera motion, for the test for dynamic pixels.
#[derive(Debug, Clone)]
pub struct RigidView<'a> {
    /// The source warped to the target.
    pub synthesised: &'a Synthesised,
    /// Its photometric error, N×1×H×W.
    pub error: &'a Tensor<4>,
    /// The motion it was made with.
    pub source_from_target: &'a Motion,
    /// K of these images, N×3×3.
    pub intrinsics: &'a Tensor<3>,
    /// K⁻¹.
    pub inverse_intrinsics: &'a Tensor<3>,
}

/// The dynamic pixels (docs/concepts/losses.md). The flow explains them and the rigid warp does not, within the limits of the settings.
/// Also, the flow leaves the epipolar line, or follows it much farther or less far than the depth allows. The test along the line is needed
/// for oncoming traffic and traffic ahead, which never leaves its epipolar lines. No gradient.
///
/// # Shapes
/// - output: `[N, 1, H, W]`
#[must_use]
pub fn moving_pixels(
    rigid: &RigidView<'_>,
    flow: &FlowView,
    settings: &MovingConfig,
) -> Tensor<4, Bool> {
    let explained_by_flow = flow
        .error
        .clone()
        .detach()
        .add_scalar(settings.margin)
        .lower(rigid.error.clone().detach());
    let [_, _, height, width] = flow.coords.dims();
    let grid = pixel_grid([height, width], &flow.coords.device());
    let ends = flow.coords.clone().detach();
    let rigid_ends = rigid.synthesised.coords.clone().detach();
    let square = |t: Tensor<4>| t.powi_scalar(2).sum_dim(1);
    let apart = square(rigid_ends.clone() - ends.clone());
    let longest = square(ends.clone() - grid.clone()).max_pair(square(rigid_ends.clone() - grid));
    let limit = longest
        .mul_scalar(settings.min_flow_share.powi(2))
        .clamp_min(settings.min_flow_px.powi(2));
    let moving = explained_by_flow
        .bool_and(apart.greater(limit))
        .bool_and(flow.visible.clone())
        .bool_and(rigid.synthesised.valid.clone());
    match impossible(&ends, &rigid_ends, rigid, settings) {
        Some(impossible) => moving.bool_and(impossible),
        None => moving,
    }
}

/// Where a static pixel could not end where the flow ends, at any depth or at any depth near the predicted one; `None` where the settings
/// require neither test.
fn impossible(
    ends: &Tensor<4>,
    rigid_ends: &Tensor<4>,
    rigid: &RigidView<'_>,
    settings: &MovingConfig,
) -> Option<Tensor<4, Bool>> {
    let motion = rigid.source_from_target;
    let beside = (settings.min_epipolar_px > 0.0).then(|| {
        epipolar_distance(ends, motion, rigid.inverse_intrinsics)
            .greater_elem(settings.min_epipolar_px)
    });
    let along = (settings.min_parallax_ratio > 0.0).then(|| {
        let start = infinitely_far(ends, motion, rigid.intrinsics, rigid.inverse_intrinsics);
        let parallax = |ends: &Tensor<4>| (ends.clone() - start.clone()).powi_scalar(2).sum_dim(1);
        let (flow, rigid) = (parallax(ends), parallax(rigid_ends));
        let square = settings.min_parallax_ratio.powi(2);
        let longer = flow.clone().greater(rigid.clone().mul_scalar(square));
        longer.bool_or(rigid.greater(flow.mul_scalar(square)))
    });
    match (beside, along) {
        (Some(beside), Some(along)) => Some(beside.bool_or(along)),
        (one, other) => one.or(other),
    }
}

/// Where each pixel would lie if it were infinitely far away, K·R·K⁻¹·p̃: the start of its parallax.
fn infinitely_far(
    like: &Tensor<4>,
    source_from_target: &Motion,
    intrinsics: &Tensor<3>,
    inverse_intrinsics: &Tensor<3>,
) -> Tensor<4> {
    let [n, _, height, width] = like.dims();
    let rotation = source_from_target.rotation.clone().detach();
    let homography = intrinsics
        .clone()
        .matmul(rotation)
        .matmul(inverse_intrinsics.clone());
    let device = like.device();
    let far = Tensor::<4>::zeros([n, 1, height, width], &device);
    ops::project(far, homography, Tensor::zeros([n, 3], &device))
}

/// The distance of each pixel's end from its epipolar line l = F·p̃, F = K⁻ᵀ·\[t\]×·R·K⁻¹. No gradient.
///
/// # Shapes
/// - `ends`: where the pixels go, `[N, 2, H, W]`, in pixels
/// - `inverse_intrinsics`: K⁻¹ of both frames, `[N, 3, 3]`
/// - output: `[N, 1, H, W]`, in pixels
#[must_use]
pub fn epipolar_distance(
    ends: &Tensor<4>,
    source_from_target: &Motion,
    inverse_intrinsics: &Tensor<3>,
) -> Tensor<4> {
    let [n, _, height, width] = ends.dims();
    let (ends, inverse) = (ends.clone().detach(), inverse_intrinsics.clone().detach());
    let fundamental = inverse
        .clone()
        .swap_dims(1, 2)
        .matmul(cross_matrix(
            source_from_target.translation.clone().detach(),
        ))
        .matmul(source_from_target.rotation.clone().detach())
        .matmul(inverse);
    let grid = pixel_grid([height, width], &ends.device());
    let line = |row: usize| {
        let entry = |column: usize| {
            fundamental
                .clone()
                .narrow(1, row, 1)
                .narrow(2, column, 1)
                .reshape([n, 1, 1, 1])
        };
        grid.clone().narrow(1, 0, 1) * entry(0) + grid.clone().narrow(1, 1, 1) * entry(1) + entry(2)
    };
    let (a, b, c) = (line(0), line(1), line(2));
    let off = a.clone() * ends.clone().narrow(1, 0, 1) + b.clone() * ends.narrow(1, 1, 1) + c;
    let length = (a.powi_scalar(2) + b.powi_scalar(2)).sqrt();
    off.abs().div(length.clamp_min(1e-12))
}
