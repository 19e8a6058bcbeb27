//! The product on tensor cores: factors rounded to bf16, sums in f32. Every 32 threads multiply 16×16 squares together.

use burn_cubecl::CubeDevice;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::client::Client;
use burn_cubecl::cubecl::cmma::{MatrixIdent, MatrixLayout};
use burn_cubecl::cubecl::features::MmaConfig;
use burn_cubecl::cubecl::ir::{ElemType, FloatKind};
use burn_cubecl::cubecl::prelude::*;

use super::factors::{Product, Sizes, result_place, share_of_group};
use super::quads::{Divisors, Lines, columns_of_thread, load_left, load_right, store};
use super::rounded::{QUAD, Quad};
use super::tile::{SIDE, THREADS, Tile, Window};

/// Threads that multiply together.
const PLANE: usize = 32;

/// Whether a device has tensor cores for bf16 that this kernel fits.
pub(in super::super::super) fn has_tensor_cores(device: &CubeDevice) -> bool {
    are_on(&device.client())
}

/// The same for a tensor's client.
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

/// The library's name for a factor's layout in shared memory: a left factor's lines are rows, a right one's columns, unless lines are
/// terms.
fn layout(product: Product, is_left: bool) -> MatrixLayout {
    if (product == Product::WeightGradient) == is_left {
        MatrixLayout::ColMajor
    } else {
        MatrixLayout::RowMajor
    }
}

/// Where a square begins in shared memory, in quads.
#[cube]
fn square(
    line: usize,
    term: usize,
    #[comptime] lines: Lines,
    #[comptime] product: Product,
) -> usize {
    let stride = comptime!(lines.stride / QUAD);
    if comptime!(product == Product::WeightGradient) {
        term * stride + line / QUAD
    } else {
        line * stride + term / QUAD
    }
}

/// Adds the products of the terms in shared memory to the sums of 32 threads' squares, whose first row and column are given.
#[cube]
fn multiply(
    left: &Shared<[Quad]>,
    right: &Shared<[Quad]>,
    sums: &Sequence<cmma::Matrix<f32>>,
    row: usize,
    column: usize,
    #[comptime] product: Product,
    #[comptime] tile: Tile,
) {
    let left_lines = comptime!(Lines::left(product, tile));
    let right_lines = comptime!(Lines::right(product, tile));
    #[unroll]
    for step in 0..tile.depth / SIDE {
        let term = comptime!(step * SIDE);
        let mut factors = Sequence::<cmma::Matrix<Quad>>::new();
        #[unroll]
        for j in 0..tile.own_columns {
            let from = square(column + comptime!(j * SIDE), term, right_lines, product);
            factors.push(cmma::Matrix::<Quad>::from_slice(
                MatrixIdent::B,
                SIDE,
                SIDE,
                SIDE,
                comptime!(layout(product, false)),
                &right[from..right_lines.room()],
                comptime!(right_lines.stride as u32),
            ));
        }
        #[unroll]
        for i in 0..tile.own_rows {
            let from = square(row + comptime!(i * SIDE), term, left_lines, product);
            let factor = cmma::Matrix::<Quad>::from_slice(
                MatrixIdent::A,
                SIDE,
                SIDE,
                SIDE,
                comptime!(layout(product, true)),
                &left[from..left_lines.room()],
                comptime!(left_lines.stride as u32),
            );
            #[unroll]
            for j in 0..tile.own_columns {
                let sum = sums.index(comptime!(i * tile.own_columns + j));
                cmma::execute(&factor, factors.index(j), sum, sum);
            }
        }
    }
}

/// The product over one part of the terms: the parts are summed afterwards. The next terms are loaded while those in shared memory are
/// multiplied.
#[cube(launch_unchecked)]
pub(super) fn product_in_bf16(
    left_values: &[Quad],
    right_values: &[Quad],
    bias: &[f32],
    out: &mut [f32],
    sizes: Sizes,
    divisors: Divisors,
    per_part: usize,
    #[comptime] product: Product,
    #[comptime] window: Window,
    #[comptime] has_bias: bool,
    #[comptime] tile: Tile,
) {
    let left_lines = comptime!(Lines::left(product, tile));
    let right_lines = comptime!(Lines::right(product, tile));
    let mut left = Shared::<[Quad]>::new_aligned_slice(comptime!(left_lines.room()), 16usize);
    let mut right = Shared::<[Quad]>::new_aligned_slice(comptime!(right_lines.room()), 16usize);
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
    let share = share_of_group(&sizes, per_part, tile);
    let columns = columns_of_thread(&share, &sizes, &divisors, product, window, tile);

    let mut start = share.start;
    let first_left = load_left(left_values, &share, start, &sizes, product, tile);
    let first_right = load_right(
        right_values,
        &columns,
        &share,
        start,
        &sizes,
        &divisors,
        product,
        window,
        tile,
    );
    store(&first_left, &mut left, left_lines);
    store(&first_right, &mut right, right_lines);
    sync_cube();
    while start < share.end {
        start += tile.depth;
        // Beyond the end, zeros are loaded, which are not multiplied.
        let next_left = load_left(left_values, &share, start, &sizes, product, tile);
        let next_right = load_right(
            right_values,
            &columns,
            &share,
            start,
            &sizes,
            &divisors,
            product,
            window,
            tile,
        );
        multiply(&left, &right, &sums, own_row, own_column, product, tile);
        sync_cube();
        store(&next_left, &mut left, left_lines);
        store(&next_right, &mut right, right_lines);
        sync_cube();
    }
    // Square by square through shared memory, since which thread has which value of a square depends on the device.
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
