//! Prepares tensors for tensor cores: rounded to bf16, and arranged so that values that are multiplied together lie together.

use burn::tensor::{DType, Shape};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use half::bf16;

use super::super::{dims, input, mirror, output, values};
use super::factors::Product;
use super::tile::SIDE;

/// Number of values that are read and written at once.
pub(super) const QUAD: usize = 4;
/// Four neighbouring values.
pub(super) type Quad = Vector<bf16, Const<QUAD>>;

/// Pixels that a group of threads rearranges at a time, in [`SIDE`] channels.
const PIXELS: usize = 128;
/// Threads of such a group.
const THREADS: usize = 256;
/// Values from a channel to the next in shared memory: one more than there are pixels, to avoid bank conflicts.
const STRIDE: usize = PIXELS + 1;

/// Rounds to the nearest bf16 number, ties to even; NaN stays NaN. On some devices a conversion alone truncates, which makes every sum too
/// small.
#[cube]
fn rounded(value: f32) -> bf16 {
    let bits = u32::reinterpret(value);
    let is_nan = (bits & 0x7fff_ffffu32) > 0x7f80_0000u32;
    let nearest = (bits + 0x7fffu32 + ((bits >> 16u32) & 1u32)) & 0xffff_0000u32;
    bf16::cast_from(f32::reinterpret(select(
        is_nan,
        bits | 0x0040_0000u32,
        nearest,
    )))
}

/// `[N, C, H, W]` to `[N, H + 2·margin, W + 2·margin, C]`, with margins that mirror the image. The grid: pixels, channels, images.
#[cube(launch_unchecked)]
fn channels_last_kernel(
    x: &[f32],
    out: &mut [Quad],
    channels: usize,
    height: i32,
    width: i32,
    margin: i32,
) {
    let mut tile = Shared::<[f32]>::new_slice(comptime!(SIDE * STRIDE));
    let thread = UNIT_POS as usize;
    let first_pixel = CUBE_POS_X as usize * PIXELS;
    let first_channel = CUBE_POS_Y as usize * SIDE;
    let image = CUBE_POS_Z as usize;
    let out_width = width + 2 * margin;
    let out_area = ((height + 2 * margin) * out_width) as usize;
    let area = (height * width) as usize;

    let own = thread % PIXELS;
    let pixel = first_pixel + own;
    if pixel < out_area {
        let y = mirror::source(pixel as i32 / out_width - margin, height);
        let x_at = mirror::source(pixel as i32 % out_width - margin, width);
        let from = (y * width + x_at) as usize;
        #[unroll]
        for i in 0..comptime!(SIDE * PIXELS / THREADS) {
            let channel = thread / PIXELS + comptime!(i * THREADS / PIXELS);
            let plane = image * channels + first_channel + channel;
            tile[channel * STRIDE + own] = x[plane * area + from];
        }
    }
    sync_cube();
    let per_pixel = comptime!(SIDE / QUAD);
    #[unroll]
    for i in 0..comptime!(SIDE / QUAD * PIXELS / THREADS) {
        let at = thread + comptime!(i * THREADS);
        let (own, channel) = (at / per_pixel, at % per_pixel * QUAD);
        let pixel = first_pixel + own;
        if pixel < out_area {
            let mut quad = Quad::new(bf16::from_int(0));
            #[unroll]
            for j in 0..QUAD {
                quad.insert(j, rounded(tile[(channel + j) * STRIDE + own]));
            }
            out[((image * out_area + pixel) * channels + first_channel + channel) / QUAD] = quad;
        }
    }
}

/// Images with the channels of a pixel together: `[N, C, H, W]` to `[N, H + 2·margin, W + 2·margin, C]` in bf16, mirrored in the margin. There
/// must be a multiple of 16 channels.
pub(super) fn channels_last(x: CubeTensor, margin: usize) -> CubeTensor {
    let [images, channels, height, width] = dims(&x);
    let (out_height, out_width) = (height + 2 * margin, width + 2 * margin);
    let out = room(&x, Shape::from([images, out_height, out_width, channels]));
    let pixels = (out_height * out_width).div_ceil(PIXELS) as u32;
    let count = CubeCount::Static(pixels, (channels / SIDE) as u32, images as u32);
    let client = out.client.clone();
    // SAFETY: pixel indices are compared with the image's size, channels come in whole groups, and a mirrored index lies in the image,
    // since the margin is narrower than the image.
    unsafe {
        channels_last_kernel::launch_unchecked(
            &client,
            count,
            CubeDim::new_1d(THREADS as u32),
            input(x),
            output(&out),
            channels,
            height as i32,
            width as i32,
            margin as i32,
        );
    }
    out
}

/// Reads each value of the left factor from a layer's weights `[O, C, kernel height, kernel width]`.
#[cube(launch_unchecked)]
fn weights_kernel(
    weights: &[f32],
    out: &mut [bf16],
    count: usize,
    out_channels: usize,
    channels: usize,
    taps: usize,
    #[comptime] product: Product,
) {
    let at = ABSOLUTE_POS;
    if at < count {
        // Row, tap and channel, of the product.
        let summed = if comptime!(product == Product::InputGradient) {
            out_channels
        } else {
            channels
        };
        let (channel, line) = (at % summed, at / summed);
        let (tap, row) = (line % taps, line / taps);
        let from = if comptime!(product == Product::InputGradient) {
            (channel * channels + row) * taps + tap
        } else {
            (row * channels + channel) * taps + tap
        };
        out[at] = rounded(weights[from]);
    }
}

/// A layer's weights as the left factor of a product: row after row, tap by tap, all channels of each together.
pub(super) fn left_factor(weights: CubeTensor, product: Product) -> CubeTensor {
    let [out_channels, channels, height, width] = dims(&weights);
    let count = out_channels * channels * height * width;
    let out = room(&weights, Shape::from([count]));
    let (groups, dim) = values(&out);
    let client = out.client.clone();
    // SAFETY: every index is compared with the sizes before it is read or written.
    unsafe {
        weights_kernel::launch_unchecked(
            &client,
            groups,
            dim,
            input(weights),
            output(&out),
            count,
            out_channels,
            channels,
            height * width,
            product,
        );
    }
    out
}

/// Memory for a tensor in bf16.
fn room(beside: &CubeTensor, shape: Shape) -> CubeTensor {
    let (client, device) = (beside.client.clone(), beside.device.clone());
    empty_device_contiguous_dtype(client, device, shape, DType::BF16)
}
