//! The operations as traits for Burn's dispatch.

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use deepfusion_kernels::Precision;

/// Stride, padding and dilation of a convolution, the same on both axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConvOptions {
    /// Step between output pixels.
    pub stride: usize,
    /// Rows and columns added on each side.
    pub padding: usize,
    /// Step between kernel taps.
    pub dilation: usize,
    /// Whether padding mirrors the image (without repeating its edge) instead of being zero.
    pub reflect: bool,
    /// Precision of the products in the kernels; [`super::autocast`] overrides it.
    pub precision: Precision,
}

impl Default for ConvOptions {
    /// Stride 1, no padding, no dilation.
    fn default() -> Self {
        Self {
            stride: 1,
            padding: 0,
            dilation: 1,
            reflect: false,
            precision: Precision::F32,
        }
    }
}

/// The forward passes, on the processor and on a GPU. Shapes are those of the functions in [`super`].
#[backend_extension(Flex, Cube: cfg(feature = "gpu"), Autodiff)]
pub(super) trait KernelOps: Backend {
    /// See [`super::depthwise`].
    fn kernel_depthwise(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        dilation: usize,
    ) -> FloatTensor<Self>;

    /// See [`super::gelu`].
    fn kernel_gelu(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`super::upsample_concat`].
    fn kernel_upsample_concat(x: FloatTensor<Self>, skip: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`super::conv2d`]; `bias` is not read unless `has_bias`. The second result is the input that the gradient of the weights reads:
    /// `x` itself, or `x` as the products need it.
    fn kernel_conv2d(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        has_bias: bool,
        options: ConvOptions,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);

    /// See [`super::batch_norm`]: output, mean, variance.
    fn kernel_batch_norm(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f64,
        relu: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);

    /// See [`super::running_statistics`]: mean, variance.
    fn kernel_running_statistics(
        mean: FloatTensor<Self>,
        variance: FloatTensor<Self>,
        batch_mean: FloatTensor<Self>,
        batch_variance: FloatTensor<Self>,
        momentum: f64,
        unbiased: f64,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);

    /// See [`super::elu`].
    fn kernel_elu(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`super::warp`].
    fn kernel_warp(image: FloatTensor<Self>, coords: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`super::local_correlation`].
    fn kernel_local_correlation(
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        radius: usize,
    ) -> FloatTensor<Self>;

    /// See [`super::project`].
    fn kernel_project(
        disparity: FloatTensor<Self>,
        homography: FloatTensor<Self>,
        shift: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// See [`super::in_view`]: 1 or 0, N×1×H×W, without gradient.
    fn kernel_in_view(coords: FloatTensor<Self>, height: usize, width: usize) -> FloatTensor<Self>;

    /// See [`super::smoothness`].
    fn kernel_smoothness(
        disparity: FloatTensor<Self>,
        image: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// See [`super::photometric_error`].
    fn kernel_photometric(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        alpha: f64,
    ) -> FloatTensor<Self>;
}

/// The backward passes, on the backend below autodiff. Each returns the gradients of the inputs. A gradient that is not needed can be left
/// out.
pub(super) trait KernelBackward: Backend {
    /// Gradient of the input of [`KernelOps::kernel_depthwise`].
    fn depthwise_grad_x(
        weight: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        dilation: usize,
    ) -> FloatTensor<Self>;

    /// Gradient of the weights of [`KernelOps::kernel_depthwise`], whose shape is given.
    fn depthwise_grad_weight(
        x: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        shape: [usize; 4],
        dilation: usize,
    ) -> FloatTensor<Self>;

    /// Gradient of [`KernelOps::kernel_gelu`] from its input.
    fn gelu_grad(x: FloatTensor<Self>, grad: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradients of x and skip of [`KernelOps::kernel_upsample_concat`]; `channels` are those of x.
    fn upsample_concat_grad(grad: FloatTensor<Self>, channels: usize) -> [FloatTensor<Self>; 2];

    /// Gradients of the input of [`KernelOps::kernel_conv2d`], which has the shape `size`, and of its weights, each if it is required.
    /// `kept` is the second result of the forward pass.
    fn conv2d_grads(
        kept: FloatTensor<Self>,
        size: [usize; 4],
        weight: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        options: ConvOptions,
        wanted: [bool; 2],
    ) -> [Option<FloatTensor<Self>>; 2];

    /// Gradient of the bias of [`KernelOps::kernel_conv2d`].
    fn conv2d_grad_bias(grad: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradients of x, γ and β of [`KernelOps::kernel_batch_norm`].
    fn batch_norm_grad(
        x: FloatTensor<Self>,
        parameters: [FloatTensor<Self>; 2],
        statistics: [FloatTensor<Self>; 2],
        grad: FloatTensor<Self>,
        epsilon: f64,
        relu: bool,
    ) -> [FloatTensor<Self>; 3];

    /// Gradient of [`KernelOps::kernel_elu`] from its output.
    fn elu_grad(output: FloatTensor<Self>, grad: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradient of the image of [`KernelOps::kernel_warp`].
    fn warp_grad_image(
        image: FloatTensor<Self>,
        coords: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// Gradient of the coordinates of [`KernelOps::kernel_warp`].
    fn warp_grad_coords(
        image: FloatTensor<Self>,
        coords: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// Gradient of the first image of [`KernelOps::kernel_local_correlation`].
    fn local_correlation_grad_first(
        second: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        radius: usize,
    ) -> FloatTensor<Self>;

    /// Gradient of the second image of [`KernelOps::kernel_local_correlation`].
    fn local_correlation_grad_second(
        first: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        radius: usize,
    ) -> FloatTensor<Self>;

    /// Gradients of disparity, homography and shift of [`KernelOps::kernel_project`].
    fn project_grad(
        disparity: FloatTensor<Self>,
        homography: FloatTensor<Self>,
        shift: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3];

    /// Gradient of the disparity of [`KernelOps::kernel_smoothness`].
    fn smoothness_grad(
        disparity: FloatTensor<Self>,
        image: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// Gradient of a of [`KernelOps::kernel_photometric`].
    fn photometric_grad(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        alpha: f64,
    ) -> FloatTensor<Self>;
}
