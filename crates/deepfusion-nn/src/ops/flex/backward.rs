//! The backward passes on the CPU.

use super::super::kernel::{ConvOptions, KernelBackward};
use super::{
    Float, Values, conv_shape, correlation_shape, count, depthwise_shape, dims, photometric_shape,
    single, smoothness_shape, tensor, warp_shape, written, zeros,
};
use burn::backend::Flex;
use deepfusion_kernels::{self as kernels, BatchNormSaved};

impl KernelBackward for Flex {
    fn depthwise_grad_x(weight: Float, grad: Float, dilation: usize) -> Float {
        let sizes: [usize; 4] = dims(&grad);
        let [_, _, kernel, _] = dims(&weight);
        let shape = depthwise_shape(sizes, kernel, dilation);
        let (weight, grad) = (Values::of(weight), Values::of(grad));
        let mut out = zeros(&sizes);
        kernels::depthwise_backward_input(&shape, weight.slice(), grad.slice(), &mut out);
        tensor(out, sizes)
    }

    fn depthwise_grad_weight(x: Float, grad: Float, sizes: [usize; 4], dilation: usize) -> Float {
        let shape = depthwise_shape(dims(&x), sizes[2], dilation);
        let (x, grad) = (Values::of(x), Values::of(grad));
        let mut out = zeros(&sizes);
        kernels::depthwise_backward_weight(&shape, x.slice(), grad.slice(), &mut out);
        tensor(out, sizes)
    }

    fn gelu_grad(x: Float, grad: Float) -> Float {
        let sizes: [usize; 4] = dims(&x);
        let (x, grad) = (Values::of(x), Values::of(grad));
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe {
            written(grad.slice().len(), |out| {
                kernels::gelu_backward(x.slice(), grad.slice(), out);
            })
        };
        tensor(out, sizes)
    }

    fn upsample_concat_grad(grad: Float, channels: usize) -> [Float; 2] {
        let [batch, all, height, width] = dims(&grad);
        let x_sizes = [batch, channels, height / 2, width / 2];
        let skip_sizes = [batch, all - channels, height, width];
        let grad = Values::of(grad);
        // SAFETY: a kernel that takes a `Slot` writes every value, here of both.
        let (grad_x, (grad_skip, ())) = unsafe {
            written(count(&x_sizes), |grad_x| {
                written(count(&skip_sizes), |grad_skip| {
                    kernels::upsample_concat_backward(
                        grad.slice(),
                        batch,
                        channels,
                        width / 2,
                        grad_x,
                        grad_skip,
                    );
                })
            })
        };
        [tensor(grad_x, x_sizes), tensor(grad_skip, skip_sizes)]
    }

    fn conv2d_grads(
        kept: Float,
        size: [usize; 4],
        weight: Float,
        grad: Float,
        options: ConvOptions,
        [wants_input, wants_weight]: [bool; 2],
    ) -> [Option<Float>; 2] {
        let weight_sizes: [usize; 4] = dims(&weight);
        let shape = conv_shape(size, weight_sizes, options);
        let (weight, grad) = (Values::of(weight), Values::of(grad));
        let of_weight = wants_weight.then(|| {
            let x = Values::of(kept);
            let mut out = zeros(&weight_sizes);
            kernels::conv2d_backward_weight(&shape, x.slice(), grad.slice(), &mut out);
            tensor(out, weight_sizes)
        });
        let of_input = wants_input.then(|| {
            // SAFETY: a kernel that takes a `Slot` writes every value.
            let (out, ()) = unsafe {
                written(shape.in_len(), |out| {
                    kernels::conv2d_backward_input(&shape, weight.slice(), grad.slice(), out);
                })
            };
            tensor(out, size)
        });
        [of_input, of_weight]
    }

    fn conv2d_grad_bias(grad: Float) -> Float {
        let [batch, channels, height, width] = dims(&grad);
        let grad = Values::of(grad);
        let mut out = zeros(&[channels]);
        kernels::channel_sums(grad.slice(), batch, height * width, &mut out);
        tensor(out, [channels])
    }

    fn batch_norm_grad(
        x: Float,
        [gamma, beta]: [Float; 2],
        [mean, variance]: [Float; 2],
        grad: Float,
        epsilon: f64,
        relu: bool,
    ) -> [Float; 3] {
        let sizes: [usize; 4] = dims(&x);
        let (x, gamma, beta) = (Values::of(x), Values::of(gamma), Values::of(beta));
        let (grad, mean, variance) = (Values::of(grad), Values::of(mean), Values::of(variance));
        let saved = BatchNormSaved {
            mean: mean.slice().to_vec(),
            variance: variance.slice().to_vec(),
        };
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (grad_x, (grad_gamma, grad_beta)) = unsafe {
            written(x.slice().len(), |grad_x| {
                kernels::batch_norm_backward(
                    x.slice(),
                    gamma.slice(),
                    beta.slice(),
                    &saved,
                    grad.slice(),
                    sizes[2] * sizes[3],
                    single(epsilon),
                    relu,
                    grad_x,
                )
            })
        };
        let channels = [sizes[1]];
        [
            tensor(grad_x, sizes),
            tensor(grad_gamma, channels),
            tensor(grad_beta, channels),
        ]
    }

    fn elu_grad(output: Float, grad: Float) -> Float {
        let sizes: [usize; 4] = dims(&output);
        let (output, grad) = (Values::of(output), Values::of(grad));
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe {
            written(grad.slice().len(), |out| {
                kernels::elu_backward(output.slice(), grad.slice(), out);
            })
        };
        tensor(out, sizes)
    }

    fn warp_grad_image(image: Float, coords: Float, grad: Float) -> Float {
        let sizes: [usize; 4] = dims(&image);
        let (_, shape) = warp_shape(&image, &coords);
        let (coords, grad) = (Values::of(coords), Values::of(grad));
        let mut out = zeros(&sizes);
        kernels::warp_backward_image(&shape, coords.slice(), grad.slice(), &mut out);
        tensor(out, sizes)
    }

    fn warp_grad_coords(image: Float, coords: Float, grad: Float) -> Float {
        let sizes: [usize; 4] = dims(&coords);
        let (_, shape) = warp_shape(&image, &coords);
        let (image, coords, grad) = (Values::of(image), Values::of(coords), Values::of(grad));
        let mut out = zeros(&sizes);
        kernels::warp_backward_coords(
            &shape,
            image.slice(),
            coords.slice(),
            grad.slice(),
            &mut out,
        );
        tensor(out, sizes)
    }

    fn local_correlation_grad_first(second: Float, grad: Float, radius: usize) -> Float {
        let sizes: [usize; 4] = dims(&second);
        let shape = correlation_shape(sizes, radius);
        let (second, grad) = (Values::of(second), Values::of(grad));
        let mut out = zeros(&sizes);
        let (second, grad) = (second.slice(), grad.slice());
        kernels::local_correlation_backward_first(&shape, second, grad, &mut out);
        tensor(out, sizes)
    }

    fn local_correlation_grad_second(first: Float, grad: Float, radius: usize) -> Float {
        let sizes: [usize; 4] = dims(&first);
        let shape = correlation_shape(sizes, radius);
        let (first, grad) = (Values::of(first), Values::of(grad));
        let mut out = zeros(&sizes);
        let (first, grad) = (first.slice(), grad.slice());
        kernels::local_correlation_backward_second(&shape, first, grad, &mut out);
        tensor(out, sizes)
    }

    fn project_grad(disparity: Float, homography: Float, shift: Float, grad: Float) -> [Float; 3] {
        let sizes: [usize; 4] = dims(&disparity);
        let (depth, homography) = (Values::of(disparity), Values::of(homography));
        let (shift, grad) = (Values::of(shift), Values::of(grad));
        let mut grad_depth = zeros(&sizes);
        let gradients = kernels::project_backward(
            (sizes[2], sizes[3]),
            depth.slice(),
            homography.slice(),
            shift.slice(),
            grad.slice(),
            &mut grad_depth,
        );
        [
            tensor(grad_depth, sizes),
            tensor(gradients.homography, [sizes[0], 3, 3]),
            tensor(gradients.shift, [sizes[0], 3]),
        ]
    }

    fn smoothness_grad(disparity: Float, image: Float, grad: Float) -> Float {
        let sizes: [usize; 4] = dims(&disparity);
        let shape = smoothness_shape(&image);
        let (disparity, image) = (Values::of(disparity), Values::of(image));
        let grad = Values::of(grad).slice()[0];
        let mut out = zeros(&sizes);
        kernels::smoothness_backward(&shape, disparity.slice(), image.slice(), grad, &mut out);
        tensor(out, sizes)
    }

    fn photometric_grad(a: Float, b: Float, grad: Float, alpha: f64) -> Float {
        let (sizes, shape) = photometric_shape(&a, alpha);
        let (a, b, grad) = (Values::of(a), Values::of(b), Values::of(grad));
        let mut out = zeros(&sizes);
        kernels::photometric_error_backward(&shape, a.slice(), b.slice(), grad.slice(), &mut out);
        tensor(out, sizes)
    }
}
