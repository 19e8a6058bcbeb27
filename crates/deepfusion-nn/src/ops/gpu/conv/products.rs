//! The product in single precision: each thread sums a few rows times a few columns in registers.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

use super::factors::{
    Product, Sizes, bring_left, bring_right, pixel_of, result_place, share_of_group,
};
use super::tile::{Tile, Window};

/// Adds the products of the terms in shared memory to a thread's sums.
#[cube]
fn multiply(
    left: &Shared<[f32]>,
    right: &Shared<[f32]>,
    sums: &mut Array<f32>,
    #[comptime] tile: Tile,
) {
    let across = comptime!(tile.columns / tile.own_columns);
    let row = UNIT_POS as usize / across * comptime!(tile.own_rows);
    let column = UNIT_POS as usize % across;
    #[unroll]
    for term in 0..tile.depth {
        let mut own = Array::<f32>::new(comptime!(tile.own_rows));
        #[unroll]
        for i in 0..tile.own_rows {
            own[i] = left[comptime!(term * (tile.rows + 1) + i) + row];
        }
        #[unroll]
        for j in 0..tile.own_columns {
            let factor = right[comptime!(term * (tile.columns + 1) + j * across) + column];
            #[unroll]
            for i in 0..tile.own_rows {
                sums[comptime!(i * tile.own_columns + j)] += own[i] * factor;
            }
        }
    }
}

/// The product over one part of the terms: the parts are summed afterwards.
#[cube(launch_unchecked)]
pub(super) fn product_in_f32(
    left_values: &[f32],
    right_values: &[f32],
    bias: &[f32],
    out: &mut [f32],
    sizes: Sizes,
    per_part: usize,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] has_bias: bool,
    #[comptime] tile: Tile,
) {
    let mut left = Shared::<[f32]>::new_slice(comptime!(tile.room(tile.rows)));
    let mut right = Shared::<[f32]>::new_slice(comptime!(tile.room(tile.columns)));
    let mut sums = Array::<f32>::new(comptime!(tile.own_rows * tile.own_columns));
    #[unroll]
    for i in 0..tile.own_rows * tile.own_columns {
        sums[i] = 0.0f32;
    }
    let thread = UNIT_POS as usize;
    let share = share_of_group(&sizes, per_part, tile);
    let column = share.first_column + thread % tile.columns;
    let own = pixel_of(column, &sizes, product, window);
    let mut start = share.start;
    while start < share.end {
        bring_left(
            left_values,
            &mut left,
            share.first_row,
            start,
            share.end,
            &sizes,
            product,
            window,
            tile,
        );
        bring_right(
            right_values,
            &mut right,
            &own,
            share.first_column,
            start,
            share.end,
            &sizes,
            product,
            window,
            tile,
        );
        sync_cube();
        multiply(&left, &right, &mut sums, tile);
        sync_cube();
        start += tile.depth;
    }
    let across = comptime!(tile.columns / tile.own_columns);
    #[unroll]
    for j in 0..tile.own_columns {
        let column = share.first_column + thread % across + comptime!(j * across);
        if column < sizes.columns {
            let (first, step) = result_place(column, share.part, &sizes, product, window, tile);
            #[unroll]
            for i in 0..tile.own_rows {
                let row = share.first_row + thread / across * tile.own_rows + i;
                if row < sizes.rows {
                    let mut value = sums[comptime!(i * tile.own_columns + j)];
                    if comptime!(has_bias) {
                        value += select(share.part == 0, bias[row], 0.0f32);
                    }
                    out[first + row * step] = value;
                }
            }
        }
    }
}
