//! Adam's step of one parameter, and the norm of a gradient.

use super::grid::over_group;
use super::{SUM_THREADS, input, output, room, summing, values};
use burn::backend::Dispatch;
use burn::backend::{Backend, TensorMetadata, backend_extension, tensor::FloatTensor};
use burn::tensor::{DType, Tensor};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::AdamStep;

/// Adam on a GPU.
#[backend_extension(Cube)]
pub(in super::super) trait AdamOps: Backend {
    /// Values and both moments after the step; all four are flat. `factors` are those of `AdamFactors`.
    fn kernel_adam(
        values: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        factors: FloatTensor<Self>,
        step: AdamStep,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);

    /// Sums of squares, each over a share of the values of six flat tensors, added to earlier such sums. Only the first `count` tensors are
    /// read.
    fn kernel_squares(
        others: FloatTensor<Self>,
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        d: FloatTensor<Self>,
        e: FloatTensor<Self>,
        f: FloatTensor<Self>,
        count: usize,
    ) -> FloatTensor<Self>;
}

/// Groups that share the values of a launch.
const GROUPS: u32 = 512;
/// Tensors of a launch.
const AT_ONCE: usize = 6;

#[cube]
fn squares_of(values: &[f32], #[comptime] threads: u32) -> f32 {
    let mut sum = 0.0f32;
    let mut at = ABSOLUTE_POS;
    while at < values.len() {
        sum += values[at] * values[at];
        at += (CUBE_COUNT_X * threads) as usize;
    }
    sum
}

#[cube(launch)]
fn squares(
    others: &[f32],
    a: &[f32],
    b: &[f32],
    c: &[f32],
    d: &[f32],
    e: &[f32],
    f: &[f32],
    shares: &mut [f32],
    #[comptime] count: usize,
    #[comptime] threads: u32,
) {
    let mut sum = squares_of(a, threads);
    if comptime!(count > 1) {
        sum += squares_of(b, threads);
    }
    if comptime!(count > 2) {
        sum += squares_of(c, threads);
    }
    if comptime!(count > 3) {
        sum += squares_of(d, threads);
    }
    if comptime!(count > 4) {
        sum += squares_of(e, threads);
    }
    if comptime!(count > 5) {
        sum += squares_of(f, threads);
    }
    let total = over_group(sum, threads);
    if UNIT_POS == 0 {
        let own = CUBE_POS_X as usize;
        shares[own] = others[own] + total;
    }
}

/// The sum of the squares of all values. A launch handles six tensors; a network has more than a hundred.
pub(in super::super) fn sum_of_squares(tensors: &[Tensor<1>]) -> Tensor<1> {
    let mut shares = Tensor::<1>::zeros([GROUPS as usize], &tensors[0].device());
    for some in tensors.chunks(AT_ONCE) {
        // Missing tensors are not read.
        let [a, b, c, d, e, f] =
            std::array::from_fn(|i| some.get(i).unwrap_or(&some[0]).clone().into_dispatch());
        let own = shares.into_dispatch();
        let sums = <Dispatch as AdamOps>::kernel_squares(own, a, b, c, d, e, f, some.len());
        shares = Tensor::from_dispatch(sums);
    }
    shares.sum()
}

#[cube(launch)]
fn adam(
    values: &[f32],
    gradient: &[f32],
    first: &[f32],
    second: &[f32],
    factors: &[f32],
    new_values: &mut [f32],
    new_first: &mut [f32],
    new_second: &mut [f32],
    beta1: f32,
    beta2: f32,
    epsilon: f32,
    learning_rate: f32,
    kept: f32,
) {
    let at = ABSOLUTE_POS;
    if at >= values.len() {
        terminate!();
    }
    let g = gradient[at] * factors[0];
    let m = first[at] * beta1 + g * (1.0f32 - beta1);
    let v = second[at] * beta2 + g * g * (1.0f32 - beta2);
    let direction = m / factors[1] / ((v / factors[2]).sqrt() + epsilon);
    let moved = values[at] * kept - direction * learning_rate;
    // Selected, not multiplied, so that a NaN gradient has no effect.
    let is_made = factors[3] > 0.5f32;
    new_values[at] = select(is_made, moved, values[at]);
    new_first[at] = select(is_made, m, first[at]);
    new_second[at] = select(is_made, v, second[at]);
}

impl AdamOps for CubeBackend {
    fn kernel_squares(
        others: CubeTensor,
        a: CubeTensor,
        b: CubeTensor,
        c: CubeTensor,
        d: CubeTensor,
        e: CubeTensor,
        f: CubeTensor,
        count: usize,
    ) -> CubeTensor {
        let shares = room(&others, [GROUPS as usize]);
        let (groups, dim) = summing(GROUPS, 1);
        squares::launch(
            &shares.client,
            groups,
            dim,
            input(others),
            input(a),
            input(b),
            input(c),
            input(d),
            input(e),
            input(f),
            output(&shares),
            count,
            SUM_THREADS,
        );
        shares
    }

    fn kernel_adam(
        old: CubeTensor,
        gradient: CubeTensor,
        first: CubeTensor,
        second: CubeTensor,
        factors: CubeTensor,
        step: AdamStep,
    ) -> (CubeTensor, CubeTensor, CubeTensor) {
        let [new, new_first, new_second] = [(); 3].map(|()| {
            let (client, device) = (old.client.clone(), old.device.clone());
            empty_device_contiguous_dtype(client, device, old.shape(), DType::F32)
        });
        let (count, dim) = values(&new);
        adam::launch(
            &new.client,
            count,
            dim,
            input(old),
            input(gradient),
            input(first),
            input(second),
            input(factors),
            output(&new),
            output(&new_first),
            output(&new_second),
            step.beta1,
            step.beta2,
            step.epsilon,
            step.learning_rate,
            1.0f32 - step.learning_rate * step.weight_decay,
        );
        (new, new_first, new_second)
    }
}
