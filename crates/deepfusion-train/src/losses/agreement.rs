use super::flow::FlowView;
use super::mean::mean_where;
use burn::tensor::{Bool, Tensor};

/// The distance between the rigid flow and the optical flow where both explain the pixel: mean ‖p' − (p +
/// f(p))‖₁ over the mask of each image, in pixels, then over the images.
///
/// # Shapes
/// - `rigid`, `flow`: where each pixel goes, `[N, 2, H, W]`, in pixels
/// - `both`: `[N, 1, H, W]`
/// - output: one value
#[must_use]
pub fn agreement(rigid: Tensor<4>, flow: Tensor<4>, both: &Tensor<4, Bool>) -> Tensor<1> {
    // The mean over u and v is half of the L1 norm.
    mean_where(rigid.sub(flow).abs(), both).mul_scalar(2.0)
}

/// Where both the rigid warp and the flow explain the pixel: in view, consistent forward and backward, and each with a smaller error than
/// no motion. Without the last condition, a car ahead at the camera's speed, whose flow is zero, would draw its own depth to infinity. No
/// gradient.
///
/// # Shapes
/// - `rigid_error`, `unwarped_error`, output: `[N, 1, H, W]`
pub(crate) fn both_explain(
    rigid_error: &Tensor<4>,
    rigid_valid: &Tensor<4, Bool>,
    flow: &FlowView,
    unwarped_error: &Tensor<4>,
) -> Tensor<4, Bool> {
    let better = |error: &Tensor<4>| error.clone().detach().lower(unwarped_error.clone());
    rigid_valid
        .clone()
        .bool_and(flow.visible.clone())
        .bool_and(better(rigid_error))
        .bool_and(better(&flow.error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn pixels_that_standing_still_explains_are_left_out() {
        let device = Device::flex();
        let row = |values: [f32; 4]| Tensor::<4>::from_data([[[values]]], &device);
        // Explained by both; by the flow alone; by neither better than by standing still; by the warp alone.
        let unwarped = row([0.5, 0.5, 0.0, 0.5]);
        let flow = FlowView {
            error: row([0.1, 0.1, 0.0, 0.6]),
            coords: Tensor::zeros([1, 2, 1, 4], &device),
            round_trip: Tensor::zeros([1, 2, 1, 4], &device),
            visible: row([1.0; 4]).greater_elem(0.5),
        };
        let rigid = row([0.2, 0.7, 0.0, 0.2]);
        let valid = row([1.0; 4]).greater_elem(0.5);
        let both = both_explain(&rigid, &valid, &flow, &unwarped);
        let both: Vec<f32> = both.float().into_data().iter().collect();
        assert_eq!(both, [1.0, 0.0, 0.0, 0.0]);
    }
}
