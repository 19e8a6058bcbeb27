use super::flow::{pixel_grid, visible};
use super::median::medians;
use crate::Motion;
use crate::model::swap_halves;
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::ops;

/// ε of the loss, as a share of the median depth, and the ridge of the fit, as a share of the mean depth.
const FLATNESS: f64 = 1e-2;

/// The affine invariant loss (Eq. 9): a and b by least squares of a·x + b on y over the valid pixels of each image;
/// (mean |a·x + b − y| + ε) / (mean |y − median(y)| + ε), averaged over the images, ε a hundredth of y's median.
///
/// It neither depends on nor changes the scale of x or y. y is the reference and has no gradient: in a batch with both directions each
/// depth is x once. The gradient of x includes that through a and b.
///
/// A flat depth is not rewarded. Equation 9 has ε in the denominator alone, so that two flat depths would cost
/// nothing. With ε in the numerator as well they cost 1, the maximum, as any depth that is unrelated to the other.
///
/// # Shapes
/// - `x`, `y`: `[N, 1, H, W]`, depths in metres
/// - `valid`: `[N, 1, H, W]`
/// - output: one value; an image without a valid pixel gives a constant
#[must_use]
pub fn affine_invariant(x: Tensor<4>, y: Tensor<4>, valid: &Tensor<4, Bool>) -> Tensor<1> {
    let [n, _, height, width] = x.dims();
    let flat = |t: Tensor<4>| t.reshape([n, height * width]);
    let outside = valid.clone().bool_not();
    let inside = flat(valid.clone().float());
    let count = inside.clone().sum_dim(1).clamp_min(1.0);
    // Values outside the mask may be anything, even NaN.
    let x = flat(x.mask_fill(outside.clone(), 0.0));
    let y = flat(y.detach().mask_fill(outside, 0.0));
    let mean = |t: Tensor<2>| t.sum_dim(1).div(count.clone());
    let (mean_x, mean_y) = (mean(x.clone()), mean(y.clone()));
    // Relative to the means, so that the sums keep the spread in f32.
    let dx = x.sub(mean_x.clone()).mul(inside.clone());
    let dy = y.clone().sub(mean_y).mul(inside.clone());
    let ridge = mean_x.mul_scalar(FLATNESS).powi_scalar(2).add_scalar(1e-12);
    let variance = mean(dx.clone().powi_scalar(2)) + ridge;
    let a = mean(dx.clone().mul(dy.clone())).div(variance);
    let residual = mean(dx.mul(a).sub(dy).abs());
    let median = medians(&y, &inside, width);
    let spread = mean(y.sub(median.clone()).mul(inside).abs());
    let floor = median.abs().mul_scalar(FLATNESS).add_scalar(1e-6);
    (residual + floor.clone()).div(spread + floor).mean()
}

/// The pixels at which two frames' depths can be compared: in view, not occluded in the other frame (its own depth
/// and motion bring them back), and static. The two halves of the batch are each other's frames. No gradient.
///
/// # Shapes
/// - `coords`: where each pixel lies in the other frame, `[2N, 2, H, W]`, in pixels
/// - `valid`, `moving`, output: `[2N, 1, H, W]`
pub(crate) fn seen_in_both(
    coords: &Tensor<4>,
    valid: &Tensor<4, Bool>,
    moving: Option<&Tensor<4, Bool>>,
) -> Tensor<4, Bool> {
    let coords = coords.clone().detach();
    let [_, _, height, width] = coords.dims();
    let flow = coords.clone() - pixel_grid([height, width], &coords.device());
    let returning = ops::warp(swap_halves(flow.clone()), coords);
    let seen = visible(&flow, &returning, valid);
    match moving {
        Some(moving) => seen.bool_and(moving.clone().bool_not()),
        None => seen,
    }
}

/// D₁→₀, the depth of the other frame seen from this one: the z of the other depth map, read where each
/// pixel lies in it, back-projected and transformed back.
///
/// # Shapes
/// - `other_depth_there`: the source's depth at `coords`, `[N, 1, H, W]`, in metres
/// - `coords`: where each target pixel lies in the source, `[N, 2, H, W]`, in pixels
/// - `target_from_source`: N motions
/// - `inverse_intrinsics`: K⁻¹ of the source, `[N, 3, 3]`
/// - output: `[N, 1, H, W]`, in metres along the target's z
#[must_use]
pub fn depth_seen_from_target(
    other_depth_there: Tensor<4>,
    coords: Tensor<4>,
    target_from_source: &Motion,
    inverse_intrinsics: &Tensor<3>,
) -> Tensor<4> {
    let [n, _, _, _] = coords.dims();
    // z = r₃·(D·K⁻¹·p̃') + t₃ = D·(m·p̃') + t₃, m the third row of R·K⁻¹.
    let row = target_from_source
        .rotation
        .clone()
        .narrow(1, 2, 1)
        .matmul(inverse_intrinsics.clone());
    let entry = |i: usize| row.clone().narrow(2, i, 1).reshape([n, 1, 1, 1]);
    let axis = |i: usize| coords.clone().narrow(1, i, 1).mul(entry(i));
    let forward = target_from_source.translation.clone().narrow(1, 2, 1);
    other_depth_there.mul(axis(0) + axis(1) + entry(2)) + forward.reshape([n, 1, 1, 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    /// Two frames of one row. All pixels stay in place, except that one pixel of the first frame moves to a place where the second frame
    /// shows another point. Neither that pixel nor the pixel of the second frame in its old place comes back.
    #[test]
    fn hidden_and_dynamic_pixels_are_left_out() {
        let device = Device::flex();
        let mask = |values: [[f32; 8]; 2]| {
            let [a, b] = values;
            Tensor::<4>::from_data([[[a]], [[b]]], &device).greater_elem(0.5)
        };
        let u = [0., 1., 2., 3., 4., 5., 6., 7.];
        let mut first = u;
        first[2] = 5.0;
        let row = [0.0; 8];
        let coords = Tensor::<4>::from_data([[[first], [row]], [[u], [row]]], &device);
        let mut valid = [[1.0; 8]; 2];
        valid[0][7] = 0.0;
        let mut moving = [[0.0; 8]; 2];
        moving[1][3] = 1.0;
        let read = |t: Tensor<4, Bool>| -> Vec<f32> { t.float().into_data().iter().collect() };
        let seen = read(seen_in_both(&coords, &mask(valid), None));
        assert_eq!(seen[..8], [1., 1., 0., 1., 1., 1., 1., 0.]);
        assert_eq!(seen[8..], [1., 1., 0., 1., 1., 1., 1., 1.]);
        let still = read(seen_in_both(&coords, &mask(valid), Some(&mask(moving))));
        assert_eq!(still[..8], seen[..8]);
        assert_eq!(still[8..], [1., 1., 0., 0., 1., 1., 1., 1.]);
    }
}
