//! Convolution and its gradients as products of matrices in tiles, whose larger matrix is never formed: its values are read from the image
//! as they are needed.
//!
//! | | rows | columns | summed over |
//! |---|---|---|---|
//! | output | output channels | output pixels of all images | weights of a channel |
//! | gradient of the input | input channels | input pixels of all images | weights that read a channel |
//! | gradient of the weights | output channels | weights of a channel | output pixels of all images |
//!
//! A group of 256 threads computes a tile: both factors are brought to shared memory 16 terms at a time, and each thread sums a few rows
//! times a few columns in registers.

use super::super::kernel::ConvOptions;
use super::grid::MOST_GROUPS;
use super::sum::over_group;
use super::{SUM_GROUPS, SUM_THREADS, dims, input, output, room, summing};
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// Threads of a group.
const THREADS: usize = 256;
/// Terms in shared memory at a time.
const DEPTH: usize = 16;
/// Groups that keep a large GPU busy.
const ENOUGH: usize = 512;

/// Rows and columns of a tile, and of what a thread computes of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Tile {
    rows: usize,
    columns: usize,
    own_rows: usize,
    own_columns: usize,
}

impl Tile {
    /// As high as there are rows, since few channels have many pixels; large where that leaves enough tiles.
    fn of(rows: usize, columns: usize) -> Self {
        let [large, small] = match rows {
            0..=16 => [Self::new(16, 256, 4, 4); 2],
            17..=32 => [Self::new(32, 128, 4, 4); 2],
            33..=64 => [Self::new(64, 256, 8, 8), Self::new(64, 64, 4, 4)],
            _ => [Self::new(128, 128, 8, 8), Self::new(64, 64, 4, 4)],
        };
        if large.count(rows, columns) >= ENOUGH / 2 {
            large
        } else {
            small
        }
    }

    fn new(rows: usize, columns: usize, own_rows: usize, own_columns: usize) -> Self {
        Self {
            rows,
            columns,
            own_rows,
            own_columns,
        }
    }

    /// Tiles of a matrix.
    fn count(self, rows: usize, columns: usize) -> usize {
        rows.div_ceil(self.rows) * columns.div_ceil(self.columns)
    }

    /// In how many parts a sum of `depth` terms is shared out, and the terms of a part: more than one where there are few tiles, of
    /// `least` terms at least.
    fn parts(self, rows: usize, columns: usize, depth: usize, least: usize) -> (usize, usize) {
        let parts = ENOUGH
            .div_ceil(self.count(rows, columns))
            .min(depth / least)
            .max(1);
        let per_part = depth.div_ceil(parts).next_multiple_of(DEPTH);
        (depth.div_ceil(per_part), per_part)
    }

    /// Columns along the first two axes, since there may be too many for one; rows, and parts, along the third.
    fn grid(self, rows: usize, columns: usize, parts: usize) -> CubeCount {
        let across = columns.div_ceil(self.columns);
        let lines = across.div_ceil(MOST_GROUPS);
        let layers = rows.div_ceil(self.rows) * parts;
        let count = [across.div_ceil(lines), lines, layers].map(|count| count as u32);
        CubeCount::Static(count[0], count[1], count[2])
    }
}

/// What a pixel of the output reads of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Window {
    height: usize,
    width: usize,
    stride: usize,
    padding: usize,
    dilation: usize,
}

impl Window {
    fn of([height, width]: [usize; 2], options: ConvOptions) -> Self {
        Self {
            height,
            width,
            stride: options.stride,
            padding: options.padding,
            dilation: options.dilation,
        }
    }

    fn taps(self) -> usize {
        self.height * self.width
    }

    /// Height and width of the output.
    fn output(self, [height, width]: [usize; 2]) -> [usize; 2] {
        let along = |size: usize, kernel: usize| {
            (size + 2 * self.padding - self.dilation * (kernel - 1) - 1) / self.stride + 1
        };
        [along(height, self.height), along(width, self.width)]
    }
}

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
    for term in 0..DEPTH {
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

#[cube]
fn zeros(#[comptime] count: usize) -> Array<f32> {
    let mut sums = Array::<f32>::new(count);
    #[unroll]
    for i in 0..count {
        sums[i] = 0.0f32;
    }
    sums
}

/// Of a part of the terms: the parts are summed afterwards.
#[cube(launch_unchecked)]
fn forward_tile(
    x: &[f32],
    weight: &[f32],
    bias: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    out_channels: usize,
    out_width: usize,
    out_area: usize,
    columns: usize,
    per_part: usize,
    #[comptime] window: Window,
    #[comptime] has_bias: bool,
    #[comptime] tile: Tile,
) {
    let mut left = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.rows + 1)));
    let mut right = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.columns + 1)));
    let mut sums = zeros(comptime!(tile.own_rows * tile.own_columns));
    let thread = UNIT_POS as usize;
    let row_tiles = out_channels.div_ceil(tile.rows);
    let first_row = CUBE_POS_Z as usize % row_tiles * tile.rows;
    let first_column = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize * tile.columns;
    let depth = channels * comptime!(window.taps());
    // The pixel whose window this thread brings.
    let column = first_column + thread % tile.columns;
    let pixel = column % out_area;
    let image = column / out_area * channels * height * width;
    let top = (pixel / out_width * window.stride) as i32 - comptime!(window.padding as i32);
    let first = (pixel % out_width * window.stride) as i32 - comptime!(window.padding as i32);
    let part = CUBE_POS_Z as usize / row_tiles;
    let mut start = part * per_part;
    let end = (start + per_part).min(depth);
    while start < end {
        let term = start + thread % DEPTH;
        #[unroll]
        for i in 0..tile.rows * DEPTH / THREADS {
            let at = thread / DEPTH + comptime!(i * THREADS / DEPTH);
            let row = first_row + at;
            let mut value = 0.0f32;
            if row < out_channels && term < end {
                value = weight[row * depth + term];
            }
            left[thread % DEPTH * comptime!(tile.rows + 1) + at] = value;
        }
        #[unroll]
        for i in 0..tile.columns * DEPTH / THREADS {
            let at = thread / tile.columns + comptime!(i * THREADS / tile.columns);
            let term = start + at;
            let tap = term % comptime!(window.taps());
            let y = top + (tap / window.width * window.dilation) as i32;
            let u = first + (tap % window.width * window.dilation) as i32;
            let mut value = 0.0f32;
            if column < columns
                && term < end
                && y >= 0
                && y < height as i32
                && u >= 0
                && u < width as i32
            {
                let channel = term / comptime!(window.taps());
                value = x[image + (channel * height + y as usize) * width + u as usize];
            }
            right[at * comptime!(tile.columns + 1) + thread % tile.columns] = value;
        }
        sync_cube();
        multiply(&left, &right, &mut sums, tile);
        sync_cube();
        start += DEPTH;
    }
    let across = comptime!(tile.columns / tile.own_columns);
    #[unroll]
    for j in 0..tile.own_columns {
        let column = first_column + thread % across + comptime!(j * across);
        if column < columns {
            let image = part * (columns / out_area) + column / out_area;
            let pixel = column % out_area;
            #[unroll]
            for i in 0..tile.own_rows {
                let row = first_row + thread / across * tile.own_rows + i;
                if row < out_channels {
                    let mut value = sums[comptime!(i * tile.own_columns + j)];
                    if comptime!(has_bias) {
                        value += select(part == 0, bias[row], 0.0f32);
                    }
                    out[(image * out_channels + row) * out_area + pixel] = value;
                }
            }
        }
    }
}

/// Of a part of the terms: the parts are summed afterwards.
#[cube(launch_unchecked)]
fn input_gradient_tile(
    grad: &[f32],
    weight: &[f32],
    out: &mut [f32],
    channels: usize,
    width: usize,
    area: usize,
    out_channels: usize,
    out_height: usize,
    out_width: usize,
    columns: usize,
    per_part: usize,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) {
    let mut left = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.rows + 1)));
    let mut right = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.columns + 1)));
    let mut sums = zeros(comptime!(tile.own_rows * tile.own_columns));
    let thread = UNIT_POS as usize;
    let row_tiles = channels.div_ceil(tile.rows);
    let first_row = CUBE_POS_Z as usize % row_tiles * tile.rows;
    let first_column = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize * tile.columns;
    let depth = out_channels * comptime!(window.taps());
    // The pixel for which this thread brings what read it.
    let column = first_column + thread % tile.columns;
    let pixel = column % area;
    let image = column / area * out_channels * out_height * out_width;
    let bottom = (pixel / width) as i32 + comptime!(window.padding as i32);
    let last = (pixel % width) as i32 + comptime!(window.padding as i32);
    let stride = comptime!(window.stride as i32);
    let part = CUBE_POS_Z as usize / row_tiles;
    let mut start = part * per_part;
    let end = (start + per_part).min(depth);
    while start < end {
        let term = start + thread % DEPTH;
        let tap = term % comptime!(window.taps());
        let out_channel = term / comptime!(window.taps());
        #[unroll]
        for i in 0..tile.rows * DEPTH / THREADS {
            let at = thread / DEPTH + comptime!(i * THREADS / DEPTH);
            let row = first_row + at;
            let mut value = 0.0f32;
            if row < channels && term < end {
                value = weight[(out_channel * channels + row) * comptime!(window.taps()) + tap];
            }
            left[thread % DEPTH * comptime!(tile.rows + 1) + at] = value;
        }
        #[unroll]
        for i in 0..tile.columns * DEPTH / THREADS {
            let at = thread / tile.columns + comptime!(i * THREADS / tile.columns);
            let term = start + at;
            let tap = term % comptime!(window.taps());
            let below = bottom - (tap / window.width * window.dilation) as i32;
            let right_of = last - (tap % window.width * window.dilation) as i32;
            let mut value = 0.0f32;
            if column < columns
                && term < end
                && below >= 0
                && right_of >= 0
                && below % stride == 0
                && right_of % stride == 0
            {
                let (y, u) = ((below / stride) as usize, (right_of / stride) as usize);
                if y < out_height && u < out_width {
                    let channel = term / comptime!(window.taps());
                    value = grad[image + (channel * out_height + y) * out_width + u];
                }
            }
            right[at * comptime!(tile.columns + 1) + thread % tile.columns] = value;
        }
        sync_cube();
        multiply(&left, &right, &mut sums, tile);
        sync_cube();
        start += DEPTH;
    }
    let across = comptime!(tile.columns / tile.own_columns);
    #[unroll]
    for j in 0..tile.own_columns {
        let column = first_column + thread % across + comptime!(j * across);
        if column < columns {
            let image = part * (columns / area) + column / area;
            let pixel = column % area;
            #[unroll]
            for i in 0..tile.own_rows {
                let row = first_row + thread / across * tile.own_rows + i;
                if row < channels {
                    out[(image * channels + row) * area + pixel] =
                        sums[comptime!(i * tile.own_columns + j)];
                }
            }
        }
    }
}

/// Of a part of the pixels: the parts are summed afterwards.
#[cube(launch_unchecked)]
fn weight_gradient_tile(
    x: &[f32],
    grad: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    out_channels: usize,
    out_width: usize,
    out_area: usize,
    pixels: usize,
    per_part: usize,
    #[comptime] window: Window,
    #[comptime] tile: Tile,
) {
    let mut left = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.rows + 1)));
    let mut right = Shared::<[f32]>::new_slice(comptime!(DEPTH * (tile.columns + 1)));
    let mut sums = zeros(comptime!(tile.own_rows * tile.own_columns));
    let thread = UNIT_POS as usize;
    let row_tiles = out_channels.div_ceil(tile.rows);
    let first_row = CUBE_POS_Z as usize % row_tiles * tile.rows;
    let first_column = (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize * tile.columns;
    let columns = channels * comptime!(window.taps());
    let part = CUBE_POS_Z as usize / row_tiles;
    let mut start = part * per_part;
    let end = (start + per_part).min(pixels);
    while start < end {
        // The pixel that this thread brings.
        let term = start + thread % DEPTH;
        let image = term / out_area;
        let pixel = term % out_area;
        let top = (pixel / out_width * window.stride) as i32 - comptime!(window.padding as i32);
        let first = (pixel % out_width * window.stride) as i32 - comptime!(window.padding as i32);
        #[unroll]
        for i in 0..tile.rows * DEPTH / THREADS {
            let at = thread / DEPTH + comptime!(i * THREADS / DEPTH);
            let row = first_row + at;
            let mut value = 0.0f32;
            if row < out_channels && term < end {
                value = grad[(image * out_channels + row) * out_area + pixel];
            }
            left[thread % DEPTH * comptime!(tile.rows + 1) + at] = value;
        }
        #[unroll]
        for i in 0..tile.columns * DEPTH / THREADS {
            let at = thread / DEPTH + comptime!(i * THREADS / DEPTH);
            let column = first_column + at;
            let tap = column % comptime!(window.taps());
            let y = top + (tap / window.width * window.dilation) as i32;
            let u = first + (tap % window.width * window.dilation) as i32;
            let mut value = 0.0f32;
            if column < columns
                && term < end
                && y >= 0
                && y < height as i32
                && u >= 0
                && u < width as i32
            {
                let channel = image * channels + column / comptime!(window.taps());
                value = x[(channel * height + y as usize) * width + u as usize];
            }
            right[thread % DEPTH * comptime!(tile.columns + 1) + at] = value;
        }
        sync_cube();
        multiply(&left, &right, &mut sums, tile);
        sync_cube();
        start += DEPTH;
    }
    let across = comptime!(tile.columns / tile.own_columns);
    #[unroll]
    for i in 0..tile.own_rows {
        let row = first_row + thread / across * tile.own_rows + i;
        #[unroll]
        for j in 0..tile.own_columns {
            let column = first_column + thread % across + comptime!(j * across);
            if row < out_channels && column < columns {
                out[(part * out_channels + row) * columns + column] =
                    sums[comptime!(i * tile.own_columns + j)];
            }
        }
    }
}

/// Each group's share of a channel's sum.
#[cube(launch)]
fn channel_shares(
    x: &[f32],
    shares: &mut [f32],
    channels: usize,
    batch: usize,
    area: usize,
    #[comptime] threads: u32,
) {
    let channel = CUBE_POS_Y as usize;
    let mut sum = 0.0f32;
    for image in 0..batch {
        let plane = (image * channels + channel) * area;
        let mut at = ABSOLUTE_POS_X as usize;
        while at < area {
            sum += x[plane + at];
            at += (CUBE_COUNT_X * threads) as usize;
        }
    }
    let total = over_group(sum, threads);
    if UNIT_POS == 0 {
        shares[CUBE_POS_X as usize * channels + channel] = total;
    }
}

/// The sum of a result's parts.
fn summed(all: CubeTensor, parts: usize, sizes: [usize; 4]) -> CubeTensor {
    let all = match parts {
        1 => all,
        _ => {
            let one = sizes.iter().product();
            let flat = CubeBackend::float_reshape(all, [parts, one].into());
            CubeBackend::float_sum_dim(flat, 0)
        }
    };
    CubeBackend::float_reshape(all, sizes.into())
}

/// Of images that are padded already where the padding mirrors.
pub(super) fn forward(
    x: CubeTensor,
    weight: CubeTensor,
    bias: CubeTensor,
    has_bias: bool,
    options: ConvOptions,
) -> CubeTensor {
    let [batch, channels, height, width] = dims(&x);
    let [out_channels, _, rows, columns] = dims(&weight);
    let window = Window::of([rows, columns], options);
    let [out_height, out_width] = window.output([height, width]);
    let out_area = out_height * out_width;
    let columns = batch * out_area;
    let tile = Tile::of(out_channels, columns);
    let depth = channels * window.taps();
    let (parts, per_part) = tile.parts(out_channels, columns, depth, 512);
    let out = room(&x, [parts * batch, out_channels, out_height, out_width]);
    // SAFETY: every place is compared with the sizes before it is read or written.
    unsafe {
        forward_tile::launch_unchecked(
            &out.client,
            tile.grid(out_channels, columns, parts),
            CubeDim::new_1d(THREADS as u32),
            input(x),
            input(weight),
            input(bias),
            output(&out),
            channels,
            height,
            width,
            out_channels,
            out_width,
            out_area,
            columns,
            per_part,
            window,
            has_bias,
            tile,
        );
    }
    summed(out, parts, [batch, out_channels, out_height, out_width])
}

/// The gradient of an input of `[N, C, height, width]`.
pub(super) fn grad_input(
    weight: CubeTensor,
    grad: CubeTensor,
    [height, width]: [usize; 2],
    options: ConvOptions,
) -> CubeTensor {
    let [out_channels, channels, rows, columns] = dims(&weight);
    let window = Window::of([rows, columns], options);
    let [batch, _, out_height, out_width] = dims(&grad);
    let area = height * width;
    let columns = batch * area;
    let tile = Tile::of(channels, columns);
    let depth = out_channels * window.taps();
    let (parts, per_part) = tile.parts(channels, columns, depth, 512);
    let out = room(&grad, [parts * batch, channels, height, width]);
    // SAFETY: every place is compared with the sizes before it is read or written.
    unsafe {
        input_gradient_tile::launch_unchecked(
            &out.client,
            tile.grid(channels, columns, parts),
            CubeDim::new_1d(THREADS as u32),
            input(grad),
            input(weight),
            output(&out),
            channels,
            width,
            area,
            out_channels,
            out_height,
            out_width,
            columns,
            per_part,
            window,
            tile,
        );
    }
    summed(out, parts, [batch, channels, height, width])
}

/// The gradient of weights of `[O, C, kernel height, kernel width]`.
pub(super) fn grad_weight(
    x: CubeTensor,
    grad: CubeTensor,
    kernel: [usize; 2],
    options: ConvOptions,
) -> CubeTensor {
    let window = Window::of(kernel, options);
    let [batch, channels, height, width] = dims(&x);
    let [_, out_channels, out_height, out_width] = dims(&grad);
    let out_area = out_height * out_width;
    let (columns, pixels) = (channels * window.taps(), batch * out_area);
    let tile = Tile::of(out_channels, columns);
    let (parts, per_part) = tile.parts(out_channels, columns, pixels, 256);
    let shares = room(&x, [parts, out_channels, channels * window.taps()]);
    // SAFETY: every place is compared with the sizes before it is read or written.
    unsafe {
        weight_gradient_tile::launch_unchecked(
            &shares.client,
            tile.grid(out_channels, columns, parts),
            CubeDim::new_1d(THREADS as u32),
            input(x),
            input(grad),
            output(&shares),
            channels,
            height,
            width,
            out_channels,
            out_width,
            out_area,
            pixels,
            per_part,
            window,
            tile,
        );
    }
    summed(
        shares,
        parts,
        [out_channels, channels, kernel[0], kernel[1]],
    )
}

pub(super) fn grad_bias(grad: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = dims(&grad);
    let shares = room(&grad, [SUM_GROUPS as usize, channels]);
    let (count, dim) = summing(SUM_GROUPS, channels);
    channel_shares::launch(
        &shares.client,
        count,
        dim,
        input(grad),
        output(&shares),
        channels,
        batch,
        height * width,
        SUM_THREADS,
    );
    CubeBackend::float_reshape(CubeBackend::float_sum_dim(shares, 0), [channels].into())
}
