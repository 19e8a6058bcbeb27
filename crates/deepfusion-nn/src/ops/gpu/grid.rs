//! How threads are arranged, and how a group of them sums.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// Threads of a group that runs along pixels.
const THREADS: u32 = 256;
/// Threads of a group that sums: the number that WebGPU guarantees.
pub(super) const SUM_THREADS: u32 = 256;
/// Groups that sum a plane together.
pub(super) const SUM_GROUPS: u32 = 32;
/// Number of groups along an axis that every GPU supports.
pub(super) const MOST_GROUPS: usize = 65_535;

/// A thread for each pixel of each plane. In a kernel, [`plane_of_group`] returns the plane.
pub(super) fn along_pixels(pixels: usize, planes: usize) -> (CubeCount, CubeDim) {
    let groups = (pixels as u32).div_ceil(THREADS);
    // Rarely are there too many planes for one axis, and then their number is usually even.
    let fits = |layers: &usize| planes.is_multiple_of(*layers) && planes / layers <= MOST_GROUPS;
    let layers = (1..=planes).find(fits).unwrap_or(1);
    let count = CubeCount::Static(groups, (planes / layers) as u32, layers as u32);
    (count, CubeDim::new_1d(THREADS))
}

/// The plane that a group of [`along_pixels`] computes.
#[cube]
pub(super) fn plane_of_group() -> usize {
    (CUBE_POS_Z * CUBE_COUNT_Y + CUBE_POS_Y) as usize
}

/// A thread for each value.
pub(super) fn values(tensor: &CubeTensor) -> (CubeCount, CubeDim) {
    let dim = CubeDim::new_1d(THREADS);
    let count = tensor.shape().num_elements();
    (
        calculate_cube_count_elemwise(&tensor.client, count, dim),
        dim,
    )
}

/// `groups` groups of threads for each plane, which sum over it.
pub(super) fn summing(groups: u32, planes: usize) -> (CubeCount, CubeDim) {
    let count = CubeCount::Static(groups, planes as u32, 1);
    (count, CubeDim::new_1d(SUM_THREADS))
}

/// The sum of all threads' values, returned to all of them. Summed as a tree, so that the order does not depend on which thread is first.
#[cube]
pub(super) fn over_group(value: f32, #[comptime] threads: u32) -> f32 {
    let mut shared = Shared::<[f32]>::new_slice(comptime!(threads as usize));
    shared[UNIT_POS as usize] = value;
    sync_cube();
    let mut half = comptime!(threads / 2).runtime();
    while half > 0 {
        if UNIT_POS < half {
            let other = shared[(UNIT_POS + half) as usize];
            shared[UNIT_POS as usize] += other;
        }
        sync_cube();
        half /= 2;
    }
    shared[0]
}
