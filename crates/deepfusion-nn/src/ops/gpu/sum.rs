//! Sums over a group of threads.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

/// The sum of every thread's value, for all of them. A tree: the order of a sum does not depend on which thread is first.
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
