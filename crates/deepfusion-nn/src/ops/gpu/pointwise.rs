//! Pointwise operations for which Burn needs several launches: the end of a residual block, and the sigmoid.

use super::{dims, input, output, room, values};
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

/// The forward passes.
#[backend_extension(Cube, Autodiff)]
pub(in super::super) trait PointwiseOps: Backend {
    /// See [`super::super::add_relu`].
    fn kernel_add_relu(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`super::super::sigmoid`].
    fn kernel_sigmoid(x: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The backward passes, each from the output.
pub(in super::super) trait PointwiseBackward: Backend {
    /// The gradient of both terms of the sum.
    fn add_relu_grad(output: FloatTensor<Self>, grad: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The gradient of the sigmoid's input.
    fn sigmoid_grad(output: FloatTensor<Self>, grad: FloatTensor<Self>) -> FloatTensor<Self>;
}

#[cube(launch)]
fn add_relu(a: &[f32], b: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    let sum = a[at] + b[at];
    // NaN stays NaN; a maximum would hide it.
    out[at] = select(sum <= 0.0f32, 0.0f32, sum);
}

#[cube(launch)]
fn add_relu_backward(y: &[f32], grad: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    out[at] = select(y[at] <= 0.0f32, 0.0f32, grad[at]);
}

#[cube(launch)]
fn sigmoid(x: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    // e^−|x| never overflows.
    let value = x[at];
    let small = (0.0f32 - value.abs()).exp();
    let large = 1.0f32 / (1.0f32 + small);
    out[at] = select(value < 0.0f32, small * large, large);
}

#[cube(launch)]
fn sigmoid_backward(y: &[f32], grad: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    out[at] = grad[at] * y[at] * (1.0f32 - y[at]);
}

impl PointwiseOps for CubeBackend {
    fn kernel_add_relu(a: CubeTensor, b: CubeTensor) -> CubeTensor {
        let out = room::<4>(&a, dims(&a));
        let (count, dim) = values(&out);
        add_relu::launch(&out.client, count, dim, input(a), input(b), output(&out));
        out
    }

    fn kernel_sigmoid(x: CubeTensor) -> CubeTensor {
        let out = room::<4>(&x, dims(&x));
        let (count, dim) = values(&out);
        sigmoid::launch(&out.client, count, dim, input(x), output(&out));
        out
    }
}

impl PointwiseBackward for CubeBackend {
    fn add_relu_grad(y: CubeTensor, grad: CubeTensor) -> CubeTensor {
        let out = room::<4>(&y, dims(&y));
        let (count, dim) = values(&out);
        add_relu_backward::launch(&out.client, count, dim, input(y), input(grad), output(&out));
        out
    }

    fn sigmoid_grad(y: CubeTensor, grad: CubeTensor) -> CubeTensor {
        let out = room::<4>(&y, dims(&y));
        let (count, dim) = values(&out);
        sigmoid_backward::launch(&out.client, count, dim, input(y), input(grad), output(&out));
        out
    }
}

#[derive(Debug)]
struct AddRelu;

impl<B: PointwiseBackward> Backward<B, 2> for AddRelu {
    type State = FloatTensor<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let grad = grads.consume::<B>(&ops.node);
        let grad = B::add_relu_grad(ops.state, grad);
        for node in ops.parents.into_iter().flatten() {
            grads.register::<B>(node.id, grad.clone());
        }
    }
}

#[derive(Debug)]
struct Sigmoid;

impl<B: PointwiseBackward> Backward<B, 1> for Sigmoid {
    type State = FloatTensor<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::sigmoid_grad(ops.state, grad));
        }
    }
}

impl<B, C> PointwiseOps for Autodiff<B, C>
where
    B: Backend + PointwiseOps + PointwiseBackward,
    C: CheckpointStrategy,
{
    fn kernel_add_relu(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self> {
        let ((a, a_node), (b, b_node)) = (a.into_parts(), b.into_parts());
        let output = B::kernel_add_relu(a, b);
        let state = output.clone();
        record!(AddRelu, C, [a_node, b_node], output, state)
    }

    fn kernel_sigmoid(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let output = B::kernel_sigmoid(x);
        let state = output.clone();
        record!(Sigmoid, C, [node], output, state)
    }
}
