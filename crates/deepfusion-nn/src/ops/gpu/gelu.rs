//! GELU, by the same series as on the processor.

use super::{dims, input, output, room, values};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::{GELU_END, GELU_SERIES};

/// Φ(x).
#[cube]
fn below(x: f32) -> f32 {
    let near = x.clamp(-GELU_END, GELU_END);
    let u = near * near * comptime!(2.0 / (GELU_END * GELU_END)) - 1.0f32;
    let mut series = 0.0f32;
    #[unroll]
    for i in 0..16usize {
        series = series * u + comptime!(GELU_SERIES[15 - i]);
    }
    near * series + 0.5f32
}

#[cube(launch)]
fn gelu(x: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    out[at] = x[at] * below(x[at]);
}

/// ∂x = ∂y·(Φ(x) + x·φ(x)), φ(x) = e^(−x²/2)/√(2π).
#[cube(launch)]
fn gelu_backward(x: &[f32], grad: &[f32], out: &mut [f32]) {
    let at = ABSOLUTE_POS;
    if at >= out.len() {
        terminate!();
    }
    let value = x[at];
    let density = 0.398_942_3f32 * (-0.5f32 * value * value).exp();
    out[at] = grad[at] * (below(value) + value * density);
}

pub(super) fn forward(x: CubeTensor) -> CubeTensor {
    let out = room::<4>(&x, dims(&x));
    let (count, dim) = values(&out);
    gelu::launch(&out.client, count, dim, input(x), output(&out));
    out
}

pub(super) fn backward(x: CubeTensor, grad: CubeTensor) -> CubeTensor {
    let out = room::<4>(&x, dims(&x));
    let (count, dim) = values(&out);
    gelu_backward::launch(&out.client, count, dim, input(x), input(grad), output(&out));
    out
}
