//! Adam's step of one parameter, and the norm of a gradient.

use super::sum::over_group;
use super::{SUM_THREADS, input, output, room, summing, values};
use burn::backend::{Backend, TensorMetadata, backend_extension, tensor::FloatTensor};
use burn::tensor::DType;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::AdamStep;

/// The step.
#[backend_extension(Cube)]
pub(in super::super) trait AdamOps: Backend {
    /// Values and both moments after the step; all four are flat.
    fn kernel_adam(
        values: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        step: AdamStep,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);

    /// Sums of squares, each of a share of the values, which are flat.
    fn kernel_squares(values: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Groups that share the values out.
const GROUPS: u32 = 512;

#[cube(launch)]
fn squares(values: &[f32], shares: &mut [f32], #[comptime] threads: u32) {
    let mut sum = 0.0f32;
    let mut at = ABSOLUTE_POS;
    while at < values.len() {
        sum += values[at] * values[at];
        at += (CUBE_COUNT_X * threads) as usize;
    }
    let total = over_group(sum, threads);
    if UNIT_POS == 0 {
        shares[CUBE_POS_X as usize] = total;
    }
}

#[cube(launch)]
fn adam(
    values: &[f32],
    gradient: &[f32],
    first: &[f32],
    second: &[f32],
    new_values: &mut [f32],
    new_first: &mut [f32],
    new_second: &mut [f32],
    gradient_scale: f32,
    beta1: f32,
    beta2: f32,
    correction1: f32,
    correction2: f32,
    epsilon: f32,
    learning_rate: f32,
    kept: f32,
) {
    let at = ABSOLUTE_POS;
    if at >= values.len() {
        terminate!();
    }
    let g = gradient[at] * gradient_scale;
    let m = first[at] * beta1 + g * (1.0f32 - beta1);
    let v = second[at] * beta2 + g * g * (1.0f32 - beta2);
    let direction = m / correction1 / ((v / correction2).sqrt() + epsilon);
    new_values[at] = values[at] * kept - direction * learning_rate;
    new_first[at] = m;
    new_second[at] = v;
}

impl AdamOps for CubeBackend {
    fn kernel_squares(values: CubeTensor) -> CubeTensor {
        let shares = room(&values, [GROUPS as usize]);
        let (count, dim) = summing(GROUPS, 1);
        squares::launch(
            &shares.client,
            count,
            dim,
            input(values),
            output(&shares),
            SUM_THREADS,
        );
        shares
    }

    fn kernel_adam(
        old: CubeTensor,
        gradient: CubeTensor,
        first: CubeTensor,
        second: CubeTensor,
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
            output(&new),
            output(&new_first),
            output(&new_second),
            step.gradient_scale,
            step.beta1,
            step.beta2,
            step.correction1,
            step.correction2,
            step.epsilon,
            step.learning_rate,
            1.0f32 - step.learning_rate * step.weight_decay,
        );
        (new, new_first, new_second)
    }
}
