use super::mean::mean_where;
use burn::tensor::{Bool, Tensor};

/// How far the rigid flow and the flow are apart where both explain the pixel: mean ‖p' − (p + f(p))‖₁ over
/// the mask, in pixels.
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
