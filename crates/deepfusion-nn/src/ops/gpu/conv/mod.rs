//! Convolution and its gradients as tiled matrix products. The larger matrix is never stored: its values are read from the image when they
//! are needed.
//!
//! | | rows | columns | summed over |
//! |---|---|---|---|
//! | output | output channels | output pixels of all images | weights of a channel |
//! | gradient of the input | input channels | input pixels of all images | weights that read a channel |
//! | gradient of the weights | output channels | weights of a channel | output pixels of all images |
//!
//! A group of 256 threads computes a tile: it loads both factors into shared memory, some terms at a time, and multiplies them there. It
//! does so in single precision (`factors`, `products`) or on tensor cores (`quads`, `tensor_cores`), for which the tensors are first
//! rounded to bf16 and rearranged (`rounded`).

mod factors;
mod products;
mod quads;
mod rounded;
pub(in super::super) mod tensor_cores;
mod tile;

use super::super::kernel::ConvOptions;
use super::grid::over_group;
use super::{SUM_GROUPS, SUM_THREADS, dims, input, mirror, output, room, summing, values};
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::Precision;
use factors::{Product, SizesLaunch, weights_by_taps};
use products::product_in_f32;
use quads::DivisorsLaunch;
use rounded::{channels_last, left_factor};
use tensor_cores::product_in_bf16;
use tile::{SIDE, THREADS, Tile, Window};

/// The sizes of a convolution's tensors.
struct Convolution {
    channels: usize,
    /// Height and width of the image with its margin.
    size: [usize; 2],
    /// Width of the mirrored margin on each side of the image, in pixels.
    margin: usize,
    out_channels: usize,
    out_size: [usize; 2],
    window: Window,
}

impl Convolution {
    /// A convolution of images with `channels` channels, of size `size`.
    fn of(
        channels: usize,
        size: [usize; 2],
        weight: [usize; 4],
        out_size: [usize; 2],
        options: ConvOptions,
    ) -> Self {
        let [out_channels, _, rows, columns] = weight;
        let (margin, inner) = mirror::margin(options);
        assert!(
            margin == 0 || size.iter().all(|side| margin < *side),
            "the mirrored margin must be smaller than the image"
        );
        Self {
            channels,
            size: size.map(|side| side + 2 * margin),
            margin,
            out_channels,
            out_size,
            window: Window::of([rows, columns], inner),
        }
    }

    /// Whether it runs on tensor cores in this precision, on the tensor's device.
    fn is_on_tensor_cores(&self, precision: Precision, beside: &CubeTensor) -> bool {
        precision.is_bf16_for(self.channels, self.out_channels)
            && tensor_cores::are_on(&beside.client)
    }

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

    /// Rows, columns and terms of a product over `images`.
    fn matrix(&self, product: Product, images: usize) -> [usize; 3] {
        let taps = self.window.taps();
        let (channels, out_channels) = (self.channels, self.out_channels);
        let pixels = |[height, width]: [usize; 2]| images * height * width;
        match product {
            Product::Output => [out_channels, pixels(self.out_size), channels * taps],
            Product::InputGradient => [channels, pixels(self.size), out_channels * taps],
            Product::WeightGradient => [out_channels, channels * taps, pixels(self.out_size)],
        }
    }

    /// The shape of a product's result.
    fn shape(&self, product: Product, images: usize) -> [usize; 4] {
        let of = |channels: usize, [height, width]: [usize; 2]| [images, channels, height, width];
        match product {
            Product::Output => of(self.out_channels, self.out_size),
            Product::InputGradient => of(self.channels, self.size),
            Product::WeightGradient => {
                let Window { height, width, .. } = self.window;
                [self.out_channels, self.channels, height, width]
            }
        }
    }

    /// The product of two factors in single precision: weights and image, or gradient and image.
    fn in_f32(
        &self,
        product: Product,
        images: usize,
        [left, right]: [CubeTensor; 2],
        bias: Option<CubeTensor>,
    ) -> CubeTensor {
        let matrix = self.matrix(product, images);
        let [rows, columns, depth] = matrix;
        let tile = Tile::of(rows, columns, false);
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
        let right = match product {
            Product::InputGradient => right,
            Product::Output | Product::WeightGradient => mirror::padded(right, self.margin),
        };
        let (parts, per_part) = tile.parts(rows, columns, depth, product.least_terms());
        let shape = self.shape(product, images);
        let out = room_for_parts(&left, parts, shape);
        let has_bias = bias.is_some();
        // Without a bias any buffer: it is not read.
        let bias = bias.unwrap_or_else(|| left.clone());
        // SAFETY: every index is compared with the sizes before it is read or written. Tap by tap, values come in whole blocks (for the
        // gradient of the weights, whole tiles), and the first index of each is compared.
        unsafe {
            product_in_f32::launch_unchecked(
                &out.client,
                tile.grid(rows, columns, parts),
                CubeDim::new_1d(THREADS as u32),
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

    /// The product of two factors on tensor cores, from tensors that [`rounded`] arranged.
    fn in_bf16(
        &self,
        product: Product,
        images: usize,
        [left, right]: [&CubeTensor; 2],
        bias: Option<CubeTensor>,
    ) -> CubeTensor {
        let matrix = self.matrix(product, images);
        let [rows, columns, depth] = matrix;
        let tile = Tile::of(rows, columns, true);
        let (parts, per_part) = tile.parts(rows, columns, depth, product.least_terms());
        let shape = self.shape(product, images);
        let out = room_for_parts(left, parts, shape);
        let (read, [height, width]) = match product {
            Product::Output | Product::WeightGradient => (self.channels, self.out_size),
            Product::InputGradient => (self.out_channels, self.size),
        };
        let has_bias = bias.is_some();
        // Without a bias any buffer: it is not read.
        let bias = bias.unwrap_or_else(|| out.clone());
        // SAFETY: every index is compared with the sizes before it is read or written, and channels come in blocks of sixteen.
        unsafe {
            product_in_bf16::launch_unchecked(
                &out.client,
                tile.grid(rows, columns, parts),
                CubeDim::new_1d(THREADS as u32),
                output(left),
                output(right),
                input(bias),
                output(&out),
                self.sizes(matrix),
                DivisorsLaunch::new(read, height * width, width),
                per_part,
                product,
                self.window,
                has_bias,
                tile,
            );
        }
        summed(out, parts, shape)
    }

    /// A layer's weights as a left factor, for products that run tap by tap.
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
        // SAFETY: every index is compared with the sizes before it is read or written.
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

/// Memory for a result in f32, one copy for each part of its sums.
fn room_for_parts(beside: &CubeTensor, parts: usize, shape: [usize; 4]) -> CubeTensor {
    let [first, others @ ..] = shape;
    room(beside, [parts * first, others[0], others[1], others[2]])
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

/// The output, and the form of the input that the gradient of the weights will read.
pub(super) fn forward(
    x: CubeTensor,
    weight: CubeTensor,
    bias: Option<CubeTensor>,
    options: ConvOptions,
) -> (CubeTensor, CubeTensor) {
    let [images, channels, height, width] = dims(&x);
    let shape @ [_, _, rows, columns] = dims(&weight);
    let out_size = Window::of([rows, columns], options).output([height, width]);
    let convolution = Convolution::of(channels, [height, width], shape, out_size, options);
    let product = Product::Output;
    if convolution.is_on_tensor_cores(options.precision, &x) {
        let image = channels_last(x, convolution.margin);
        let left = left_factor(weight, product);
        let out = convolution.in_bf16(product, images, [&left, &image], bias);
        (out, image)
    } else {
        let out = convolution.in_f32(product, images, [weight, x.clone()], bias);
        (out, x)
    }
}

/// The gradients of the input, `[N, C, height, width]`, and of the weights, each if it is required.
pub(super) fn backward(
    kept: CubeTensor,
    size @ [_, channels, height, width]: [usize; 4],
    weight: CubeTensor,
    grad: CubeTensor,
    options: ConvOptions,
    [wants_input, wants_weight]: [bool; 2],
) -> [Option<CubeTensor>; 2] {
    let [images, ..] = size;
    let shape = dims(&weight);
    let [_, _, out_height, out_width] = dims(&grad);
    let out_size = [out_height, out_width];
    let convolution = Convolution::of(channels, [height, width], shape, out_size, options);
    let (of_input, of_weights) = (Product::InputGradient, Product::WeightGradient);
    let [grad_of_input, grad_of_weights] = if !(wants_input || wants_weight) {
        [None, None]
    } else if convolution.is_on_tensor_cores(options.precision, &grad) {
        let grad = channels_last(grad, 0);
        let grad_of_input = wants_input.then(|| {
            let left = left_factor(weight, of_input);
            convolution.in_bf16(of_input, images, [&left, &grad], None)
        });
        let grad_of_weights =
            wants_weight.then(|| convolution.in_bf16(of_weights, images, [&grad, &kept], None));
        [grad_of_input, grad_of_weights]
    } else {
        let grad_of_weights = wants_weight
            .then(|| convolution.in_f32(of_weights, images, [grad.clone(), kept], None));
        let grad_of_input =
            wants_input.then(|| convolution.in_f32(of_input, images, [weight, grad], None));
        [grad_of_input, grad_of_weights]
    };
    // The gradient is that of the image with its mirrored margin.
    let grad_of_input = grad_of_input.map(|grad| match convolution.margin {
        0 => grad,
        margin => mirror::backward(grad, margin),
    });
    [grad_of_input, grad_of_weights]
}

/// Sums each group's share of a channel.
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
