//! Convolution and its gradients as products of matrices in tiles, whose larger matrix is never formed: its values are read from the image
//! as they are needed.
//!
//! | | rows | columns | summed over |
//! |---|---|---|---|
//! | output | output channels | output pixels of all images | weights of a channel |
//! | gradient of the input | input channels | input pixels of all images | weights that read a channel |
//! | gradient of the weights | output channels | weights of a channel | output pixels of all images |
//!
//! A group of 256 threads computes a tile: both factors are brought to shared memory some terms at a time (`factors`), and multiplied there,
//! in single precision (`products`) or rounded to bf16 on tensor cores (`tensor_cores`).

mod factors;
mod products;
pub(in super::super) mod tensor_cores;
mod tile;

use super::super::kernel::ConvOptions;
use super::sum::over_group;
use super::{SUM_GROUPS, SUM_THREADS, dims, input, output, room, summing, values};
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::Precision;
use factors::{Product, SizesLaunch, weights_by_taps};
use products::product_in_f32;
use tensor_cores::product_in_bf16;
use tile::{SIDE, THREADS, Tile, Window};

/// A convolution's tensors by their sizes.
struct Convolution {
    channels: usize,
    size: [usize; 2],
    out_channels: usize,
    out_size: [usize; 2],
    window: Window,
    precision: Precision,
}

impl Convolution {
    fn sizes(&self, [rows, columns, depth]: [usize; 3]) -> SizesLaunch {
        let [height, width] = self.size;
        let [out_height, out_width] = self.out_size;
        SizesLaunch::new(
            self.channels,
            height,
            width,
            self.out_channels,
            out_height,
            out_width,
            rows,
            columns,
            depth,
        )
    }

    /// The product of both factors, of `rows` times `columns` sums of `depth` terms, as a tensor of `shape`. Sums are shared out in
    /// parts of `least` terms at least.
    fn product(
        &self,
        product: Product,
        [left, right]: [CubeTensor; 2],
        bias: Option<CubeTensor>,
        matrix @ [rows, columns, depth]: [usize; 3],
        least: usize,
        shape: [usize; 4],
    ) -> CubeTensor {
        let [left, right] = [left, right].map(into_contiguous);
        let on_tensor_cores = self.precision.is_bf16_for(self.channels, self.out_channels)
            && tensor_cores::are_on(&left.client);
        let tile = Tile::of(rows, columns, on_tensor_cores);
        let tile = match product {
            Product::Output => tile.tap_by_tap(self.channels, SIDE),
            Product::InputGradient => tile.tap_by_tap(self.out_channels, SIDE),
            Product::WeightGradient => tile.tap_by_tap(self.channels, tile.columns),
        };
        let left = match product {
            Product::WeightGradient => left,
            _ if !tile.tap_by_tap => left,
            _ if self.window.taps() == 1 && product == Product::Output => left,
            _ => self.weights_by_taps(product, left, matrix, tile),
        };
        let (parts, per_part) = tile.parts(rows, columns, depth, least);
        let [first, others @ ..] = shape;
        let out = room(&left, [parts * first, others[0], others[1], others[2]]);
        let client = out.client.clone();
        let has_bias = bias.is_some();
        // Without one a buffer that is not read.
        let bias = bias.unwrap_or_else(|| left.clone());
        let (count, dim) = (
            tile.grid(rows, columns, parts),
            CubeDim::new_1d(THREADS as u32),
        );
        let launch = if on_tensor_cores {
            product_in_bf16::launch_unchecked
        } else {
            product_in_f32::launch_unchecked
        };
        // SAFETY: every place is compared with the sizes before it is read or written; what is taken tap by tap comes in whole blocks, or
        // for the gradient of the weights whole tiles, of which the first place is compared.
        unsafe {
            launch(
                &client,
                count,
                dim,
                input(left),
                input(right),
                input(bias),
                output(&out),
                self.sizes(matrix),
                per_part,
                product,
                self.window,
                has_bias,
                tile,
            );
        }
        summed(out, parts, shape)
    }

    /// The left factor of a layer's weights, where they are taken tap by tap.
    fn weights_by_taps(
        &self,
        product: Product,
        weights: CubeTensor,
        matrix @ [rows, _, depth]: [usize; 3],
        tile: Tile,
    ) -> CubeTensor {
        let out = room(&weights, [rows, depth]);
        let (count, dim) = values(&out);
        let client = out.client.clone();
        // SAFETY: every place is compared with the sizes before it is read or written.
        unsafe {
            weights_by_taps::launch_unchecked(
                &client,
                count,
                dim,
                input(weights),
                output(&out),
                self.sizes(matrix),
                product,
                self.window,
                tile,
            );
        }
        out
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
    bias: Option<CubeTensor>,
    options: ConvOptions,
) -> CubeTensor {
    let [images, channels, height, width] = dims(&x);
    let [out_channels, _, rows, columns] = dims(&weight);
    let window = Window::of([rows, columns], options);
    let out_size @ [out_height, out_width] = window.output([height, width]);
    let convolution = Convolution {
        channels,
        size: [height, width],
        out_channels,
        out_size,
        window,
        precision: options.precision,
    };
    let matrix = [
        out_channels,
        images * out_height * out_width,
        channels * window.taps(),
    ];
    let shape = [images, out_channels, out_height, out_width];
    convolution.product(Product::Output, [weight, x], bias, matrix, 512, shape)
}

/// The gradient of an input of `[N, C, height, width]`.
pub(super) fn grad_input(
    weight: CubeTensor,
    grad: CubeTensor,
    size @ [height, width]: [usize; 2],
    options: ConvOptions,
) -> CubeTensor {
    let [out_channels, channels, rows, columns] = dims(&weight);
    let window = Window::of([rows, columns], options);
    let [images, _, out_height, out_width] = dims(&grad);
    let convolution = Convolution {
        channels,
        size,
        out_channels,
        out_size: [out_height, out_width],
        window,
        precision: options.precision,
    };
    let matrix = [
        channels,
        images * height * width,
        out_channels * window.taps(),
    ];
    convolution.product(
        Product::InputGradient,
        [weight, grad],
        None,
        matrix,
        512,
        [images, channels, height, width],
    )
}

/// The gradient of weights of `[O, C, kernel height, kernel width]`.
pub(super) fn grad_weight(
    x: CubeTensor,
    grad: CubeTensor,
    kernel: [usize; 2],
    options: ConvOptions,
) -> CubeTensor {
    let window = Window::of(kernel, options);
    let [images, channels, height, width] = dims(&x);
    let [_, out_channels, out_height, out_width] = dims(&grad);
    let convolution = Convolution {
        channels,
        size: [height, width],
        out_channels,
        out_size: [out_height, out_width],
        window,
        precision: options.precision,
    };
    let matrix = [
        out_channels,
        channels * window.taps(),
        images * out_height * out_width,
    ];
    convolution.product(
        Product::WeightGradient,
        [grad, x],
        None,
        matrix,
        256,
        [out_channels, channels, kernel[0], kernel[1]],
    )
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
