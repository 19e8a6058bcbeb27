//! Bilinear enlargement with half-pixel centres.

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn::backend::autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Backend, TensorMetadata, backend_extension, tensor::FloatTensor};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// The forward pass.
#[backend_extension(Cube, Autodiff)]
pub(in super::super) trait EnlargeOps: Backend {
    /// See [`super::super::enlarged_on_gpu`].
    fn kernel_enlarge(x: FloatTensor<Self>, height: usize, width: usize) -> FloatTensor<Self>;
}

/// The backward pass.
pub(in super::super) trait EnlargeBackward: Backend {
    /// The gradient of an input of this height and width.
    fn enlarge_grad(grad: FloatTensor<Self>, height: usize, width: usize) -> FloatTensor<Self>;
}

/// The two pixels along an axis between which a pixel of the result lies, and its fraction of the way to the second.
#[derive(CubeType)]
struct PixelPair {
    low: i32,
    high: i32,
    fraction: f32,
}

#[cube]
fn between(at: i32, from: i32, to: i32) -> PixelPair {
    let last = from - 1;
    let position = (at as f32 + 0.5f32) * from as f32 / to as f32 - 0.5f32;
    let position = position.max(0.0f32).min(last as f32);
    let low = position.floor() as i32;
    PixelPair {
        low,
        high: (low + 1).min(last),
        fraction: position - low as f32,
    }
}

#[cube(launch)]
fn enlarge(x: &[f32], out: &mut [f32], height: i32, width: i32, out_height: i32, out_width: i32) {
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= out_height * out_width {
        terminate!();
    }
    let plane = plane_of_group();
    let from = plane * (height * width) as usize;
    let down = between(pixel / out_width, height, out_height);
    let across = between(pixel % out_width, width, out_width);
    let (above, below) = (down.low * width, down.high * width);
    let upper = x[from + (above + across.low) as usize] * (1.0f32 - across.fraction)
        + x[from + (above + across.high) as usize] * across.fraction;
    let lower = x[from + (below + across.low) as usize] * (1.0f32 - across.fraction)
        + x[from + (below + across.high) as usize] * across.fraction;
    let area = (out_height * out_width) as usize;
    out[plane * area + pixel as usize] = upper * (1.0f32 - down.fraction) + lower * down.fraction;
}

/// The weight of an input pixel in a pixel of the result, along an axis.
#[cube]
fn share(own: i32, at: i32, from: i32, to: i32) -> f32 {
    let place = between(at, from, to);
    select(place.low == own, 1.0f32 - place.fraction, 0.0f32)
        + select(place.high == own, place.fraction, 0.0f32)
}

/// A range (start and end) of the result's pixels along an axis that contains all pixels with a share of an input pixel.
#[cube]
fn readers(own: i32, from: i32, to: i32) -> (i32, i32) {
    let scale = to as f32 / from as f32;
    let first = ((own as f32 - 0.5f32) * scale - 0.5f32).floor() as i32;
    let end = ((own as f32 + 1.5f32) * scale - 0.5f32).ceil() as i32 + 1;
    (
        select(own == 0, 0, first.max(0)),
        select(own == from - 1, to, end.min(to)),
    )
}

#[cube(launch)]
fn enlarge_backward(
    grad: &[f32],
    out: &mut [f32],
    height: i32,
    width: i32,
    out_height: i32,
    out_width: i32,
) {
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= height * width {
        terminate!();
    }
    let plane = plane_of_group();
    let from = plane * (out_height * out_width) as usize;
    let (own_y, own_x) = (pixel / width, pixel % width);
    let (first_y, end_y) = readers(own_y, height, out_height);
    let (first_x, end_x) = readers(own_x, width, out_width);
    let mut sum = 0.0f32;
    for y in first_y..end_y {
        let of_row = share(own_y, y, height, out_height);
        let mut row = 0.0f32;
        for x in first_x..end_x {
            let of_pixel = share(own_x, x, width, out_width);
            row += grad[from + (y * out_width + x) as usize] * of_pixel;
        }
        sum += row * of_row;
    }
    out[plane * (height * width) as usize + pixel as usize] = sum;
}

impl EnlargeOps for CubeBackend {
    fn kernel_enlarge(x: CubeTensor, out_height: usize, out_width: usize) -> CubeTensor {
        let [batch, channels, height, width] = dims(&x);
        let out = room(&x, [batch, channels, out_height, out_width]);
        let (count, dim) = along_pixels(out_height * out_width, batch * channels);
        let client = out.client.clone();
        enlarge::launch(
            &client,
            count,
            dim,
            input(x),
            output(&out),
            height as i32,
            width as i32,
            out_height as i32,
            out_width as i32,
        );
        out
    }
}

impl EnlargeBackward for CubeBackend {
    fn enlarge_grad(grad: CubeTensor, height: usize, width: usize) -> CubeTensor {
        let [batch, channels, out_height, out_width] = dims(&grad);
        let out = room(&grad, [batch, channels, height, width]);
        let (count, dim) = along_pixels(height * width, batch * channels);
        let client = out.client.clone();
        enlarge_backward::launch(
            &client,
            count,
            dim,
            input(grad),
            output(&out),
            height as i32,
            width as i32,
            out_height as i32,
            out_width as i32,
        );
        out
    }
}

#[derive(Debug)]
struct Enlarge;

impl<B: EnlargeBackward> Backward<B, 1> for Enlarge {
    type State = [usize; 2];

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [height, width] = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::enlarge_grad(grad, height, width));
        }
    }
}

impl<B, C> EnlargeOps for Autodiff<B, C>
where
    B: Backend + EnlargeOps + EnlargeBackward,
    C: CheckpointStrategy,
{
    fn kernel_enlarge(x: FloatTensor<Self>, height: usize, width: usize) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let size = [x.shape()[2], x.shape()[3]];
        let output = B::kernel_enlarge(x, height, width);
        record!(Enlarge, C, [node], output, size)
    }
}
