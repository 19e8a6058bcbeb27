//! The product on tensor cores: factors rounded to bf16, sums in f32. Each 32 threads multiply squares of 16.

use burn_cubecl::CubeDevice;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::client::Client;
use burn_cubecl::cubecl::cmma::{MatrixIdent, MatrixLayout};
use burn_cubecl::cubecl::features::MmaConfig;
use burn_cubecl::cubecl::ir::{ElemType, FloatKind};
use burn_cubecl::cubecl::prelude::*;
use half::bf16;

use super::factors::{
    Product, Sizes, bring_left, bring_right, pixel_of, result_place, share_of_group,
};
use super::tile::{SIDE, THREADS, Tile, Window};

/// Threads that multiply together.
const PLANE: usize = 32;

/// Whether a device has tensor cores for bf16 that this kernel fits.
pub(in super::super::super) fn has_tensor_cores(device: &CubeDevice) -> bool {
    are_on(&device.client())
}

/// The same of a tensor's client.
pub(super) fn are_on(client: &Client) -> bool {
    let properties = client.properties();
    let square = MmaConfig {
        a_type: ElemType::Float(FloatKind::BF16),
        b_type: ElemType::Float(FloatKind::BF16),
        cd_type: ElemType::Float(FloatKind::F32),
        m: SIDE as u32,
        n: SIDE as u32,
        k: SIDE as u32,
    };
    let planes = [
        properties.hardware.plane_size_min,
        properties.hardware.plane_size_max,
    ];
    planes == [PLANE as u32; 2] && properties.features.matmul.cmma.contains(&square)
}

/// How a factor lies in shared memory.
fn layout(tile: Tile, neighbours_are_terms: bool, is_left: bool) -> MatrixLayout {
    // A left factor's line is a row, a right one's a column.
    if tile.by_terms(neighbours_are_terms) == is_left {
        MatrixLayout::RowMajor
    } else {
        MatrixLayout::ColMajor
    }
}

/// Of a part of the terms: the parts are summed afterwards.
#[cube(launch_unchecked)]
pub(super) fn product_in_bf16(
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
    let by_terms = comptime!(product.right_by_terms());
    let left_room = comptime!(tile.room(tile.rows, true));
    let right_room = comptime!(tile.room(tile.columns, by_terms));
    let mut left = Shared::<[bf16]>::new_aligned_slice(left_room, 16usize);
    let mut right = Shared::<[bf16]>::new_aligned_slice(right_room, 16usize);
    let staged = comptime!(THREADS / PLANE * SIDE * SIDE);
    let mut stage = Shared::<[f32]>::new_aligned_slice(staged, 16usize);
    let mut sums = Sequence::<cmma::Matrix<f32>>::new();
    #[unroll]
    for _ in 0..tile.own_rows * tile.own_columns {
        sums.push(cmma::Matrix::<f32>::from_value(
            MatrixIdent::Accumulator,
            SIDE,
            SIDE,
            SIDE,
            MatrixLayout::Undefined,
            0.0f32,
        ));
    }
    let thread = UNIT_POS as usize;
    // The squares of these 32 threads.
    let plane = thread / PLANE;
    let across = comptime!(tile.columns / SIDE / tile.own_columns);
    let own_row = plane / across * comptime!(tile.own_rows * SIDE);
    let own_column = plane % across * comptime!(tile.own_columns * SIDE);
    // From a row and from a term to the next of the left factor, and from a term and a column of the right one.
    let left_stride = comptime!(tile.stride(tile.rows, true));
    let right_stride = comptime!(tile.stride(tile.columns, by_terms));
    let share = share_of_group(&sizes, per_part, tile);
    let column = share.first_column + thread % tile.columns;
    let own = pixel_of(column, &sizes, product, window);
    let mut start = share.start;
    while start < share.end {
        bring_left::<bf16>(
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
        bring_right::<bf16>(
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
        #[unroll]
        for step in 0..tile.depth / SIDE {
            let term = comptime!(step * SIDE);
            let mut factors = Sequence::<cmma::Matrix<bf16>>::new();
            #[unroll]
            for j in 0..tile.own_columns {
                let line = own_column + comptime!(j * SIDE);
                let from = if comptime!(by_terms) {
                    line * right_stride + term
                } else {
                    line + comptime!(term * right_stride)
                };
                factors.push(cmma::Matrix::<bf16>::from_slice(
                    MatrixIdent::B,
                    SIDE,
                    SIDE,
                    SIDE,
                    comptime!(layout(tile, by_terms, false)),
                    &right[from..right_room],
                    comptime!(right_stride as u32),
                ));
            }
            #[unroll]
            for i in 0..tile.own_rows {
                let from = (own_row + comptime!(i * SIDE)) * left_stride + term;
                let factor = cmma::Matrix::<bf16>::from_slice(
                    MatrixIdent::A,
                    SIDE,
                    SIDE,
                    SIDE,
                    comptime!(layout(tile, true, true)),
                    &left[from..left_room],
                    comptime!(left_stride as u32),
                );
                #[unroll]
                for j in 0..tile.own_columns {
                    let sum = sums.index(comptime!(i * tile.own_columns + j));
                    cmma::execute(&factor, factors.index(j), sum, sum);
                }
            }
        }
        sync_cube();
        start += tile.depth;
    }
    // Square by square through shared memory, as which thread holds which value of a square is the device's secret.
    let lane = thread % PLANE;
    #[unroll]
    for i in 0..tile.own_rows {
        #[unroll]
        for j in 0..tile.own_columns {
            let from = plane * comptime!(SIDE * SIDE);
            cmma::store(
                &mut stage[from..staged],
                sums.index(comptime!(i * tile.own_columns + j)),
                comptime!(SIDE as u32),
                MatrixLayout::RowMajor,
            );
            sync_cube();
            let column = share.first_column + own_column + comptime!(j * SIDE) + lane % SIDE;
            if column < sizes.columns {
                let (first, step) = result_place(column, share.part, &sizes, product, window, tile);
                #[unroll]
                for k in 0..comptime!(SIDE * SIDE / PLANE) {
                    let line = lane / SIDE + comptime!(k * PLANE / SIDE);
                    let row = share.first_row + own_row + comptime!(i * SIDE) + line;
                    if row < sizes.rows {
                        let mut value = stage[from + line * SIDE + lane % SIDE];
                        if comptime!(has_bias) {
                            value += select(share.part == 0, bias[row], 0.0f32);
                        }
                        out[first + row * step] = value;
                    }
                }
            }
            sync_cube();
        }
    }
}
