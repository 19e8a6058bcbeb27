//! ELU.

use super::{input, output, room, values};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

#[cube(launch)]
fn elu(x: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    let value = x[at];
    // NaN stays NaN.
    out[at] = select(
        value > 0.0f32 || value.is_nan(),
        value,
        value.min(0.0f32).exp() - 1.0f32,
    );
}

/// Below 0 the derivative is eˣ, the output plus 1.
#[cube(launch)]
fn elu_backward(y: &[f32], grad: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    let value = y[at];
    out[at] = grad[at] * select(value > 0.0f32, 1.0f32, value + 1.0f32);
}

pub(super) fn forward(x: CubeTensor) -> CubeTensor {
    let out = room::<4>(&x, super::dims(&x));
    let (count, dim) = values(&out);
    elu::launch(&out.client, count, dim, input(x), output(&out));
    out
}

pub(super) fn backward(y: CubeTensor, grad: CubeTensor) -> CubeTensor {
    let out = room::<4>(&y, super::dims(&y));
    let (count, dim) = values(&out);
    elu_backward::launch(&out.client, count, dim, input(y), input(grad), output(&out));
    out
}
