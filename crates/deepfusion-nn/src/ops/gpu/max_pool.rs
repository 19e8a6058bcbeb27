//! ResNet's 3×3 maximum at stride 2, padded by one.

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn::backend::autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// The forward pass.
#[backend_extension(Cube, Autodiff)]
pub(in super::super) trait MaxPoolOps: Backend {
    /// See [`super::super::max_pool_3x3_stride_2`].
    fn kernel_max_pool(x: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The backward pass.
pub(in super::super) trait MaxPoolBackward: Backend {
    /// The gradient of the input, from the input, the output and the output's gradient.
    fn max_pool_grad(
        x: FloatTensor<Self>,
        output: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

#[cube(launch)]
fn max_pool(x: &[f32], out: &mut [f32], height: i32, width: i32) {
    let (out_height, out_width) = ((height + 1) / 2, (width + 1) / 2);
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= out_height * out_width {
        terminate!();
    }
    let plane = plane_of_group();
    let from = plane * (height * width) as usize;
    let (middle_y, middle_x) = (pixel / out_width * 2, pixel % out_width * 2);
    // The middle of a window is always in the image.
    let mut most = x[from + (middle_y * width + middle_x) as usize];
    #[unroll]
    for tap in 0..9u32 {
        let y = middle_y + comptime!(tap as i32 / 3 - 1);
        let at = middle_x + comptime!(tap as i32 % 3 - 1);
        if y >= 0 && y < height && at >= 0 && at < width {
            let value = x[from + (y * width + at) as usize];
            // NaN counts as greater than anything.
            most = select(value > most || value.is_nan(), value, most);
        }
    }
    out[plane * (out_height * out_width) as usize + pixel as usize] = most;
}

/// A pixel gets the gradient of each window whose maximum it is, unless an earlier pixel of the window is equally large.
#[cube(launch)]
fn max_pool_backward(x: &[f32], y: &[f32], grad: &[f32], out: &mut [f32], height: i32, width: i32) {
    let (out_height, out_width) = ((height + 1) / 2, (width + 1) / 2);
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= height * width {
        terminate!();
    }
    let plane = plane_of_group();
    let from = plane * (height * width) as usize;
    let results = plane * (out_height * out_width) as usize;
    let (own_y, own_x) = (pixel / width, pixel % width);
    let own = x[from + pixel as usize];
    let mut sum = 0.0f32;
    // Along each axis, the windows around 2·(y/2) and, for an odd y, the next one.
    #[unroll]
    for i in 0..4u32 {
        let window_y = own_y / 2 + comptime!(i as i32 / 2);
        let window_x = own_x / 2 + comptime!(i as i32 % 2);
        let (down, across) = (own_y - 2 * window_y, own_x - 2 * window_x);
        let reads = down >= -1 && across >= -1 && down <= 1 && across <= 1;
        if reads && window_y < out_height && window_x < out_width {
            let window = results + (window_y * out_width + window_x) as usize;
            let most = y[window];
            if own == most || (own.is_nan() && most.is_nan()) {
                let place = (down + 1) * 3 + across + 1;
                let mut is_first = true;
                #[unroll]
                for tap in 0..8u32 {
                    let before = comptime!(tap as i32) < place;
                    let tap_y = 2 * window_y + comptime!(tap as i32 / 3 - 1);
                    let tap_x = 2 * window_x + comptime!(tap as i32 % 3 - 1);
                    let inside = tap_y >= 0 && tap_y < height && tap_x >= 0 && tap_x < width;
                    if before && inside {
                        let other = x[from + (tap_y * width + tap_x) as usize];
                        is_first = is_first && other != most;
                    }
                }
                if is_first {
                    sum += grad[window];
                }
            }
        }
    }
    out[from + pixel as usize] = sum;
}

impl MaxPoolOps for CubeBackend {
    fn kernel_max_pool(x: CubeTensor) -> CubeTensor {
        let [batch, channels, height, width] = dims(&x);
        let (out_height, out_width) = (height.div_ceil(2), width.div_ceil(2));
        let out = room(&x, [batch, channels, out_height, out_width]);
        let (count, dim) = along_pixels(out_height * out_width, batch * channels);
        let client = out.client.clone();
        let (height, width) = (height as i32, width as i32);
        max_pool::launch(&client, count, dim, input(x), output(&out), height, width);
        out
    }
}

impl MaxPoolBackward for CubeBackend {
    fn max_pool_grad(x: CubeTensor, y: CubeTensor, grad: CubeTensor) -> CubeTensor {
        let sizes @ [batch, channels, height, width] = dims(&x);
        let out = room(&x, sizes);
        let (count, dim) = along_pixels(height * width, batch * channels);
        let client = out.client.clone();
        max_pool_backward::launch(
            &client,
            count,
            dim,
            input(x),
            input(y),
            input(grad),
            output(&out),
            height as i32,
            width as i32,
        );
        out
    }
}

#[derive(Debug)]
struct MaxPool;

impl<B: MaxPoolBackward> Backward<B, 1> for MaxPool {
    type State = [FloatTensor<B>; 2];

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [x, output] = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::max_pool_grad(x, output, grad));
        }
    }
}

impl<B, C> MaxPoolOps for Autodiff<B, C>
where
    B: Backend + MaxPoolOps + MaxPoolBackward,
    C: CheckpointStrategy,
{
    fn kernel_max_pool(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let output = B::kernel_max_pool(x.clone());
        let state = [x, output.clone()];
        record!(MaxPool, C, [node], output, state)
    }
}
