//! How the operations are differentiated: what each keeps from its forward pass, and which of its parents receive a gradient.

use super::kernel::{ConvOptions, KernelBackward, KernelOps};
use burn::backend::autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{AutodiffBackend, Backend, TensorMetadata, tensor::FloatTensor};

#[derive(Debug)]
struct Conv2d;

impl<B: KernelBackward> Backward<B, 3> for Conv2d {
    type State = (FloatTensor<B>, [usize; 4], FloatTensor<B>, ConvOptions);

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (kept, size, weight, options) = ops.state;
        let [x_node, weight_node, bias_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        if let Some(node) = bias_node {
            grads.register::<B>(node.id, B::conv2d_grad_bias(grad.clone()));
        }
        let wanted = [x_node.is_some(), weight_node.is_some()];
        let gradients = B::conv2d_grads(kept, size, weight, grad, options, wanted);
        for (node, grad) in [x_node, weight_node].into_iter().zip(gradients) {
            if let (Some(node), Some(grad)) = (node, grad) {
                grads.register::<B>(node.id, grad);
            }
        }
    }
}

#[derive(Debug)]
struct BatchNorm;

impl<B: KernelBackward> Backward<B, 3> for BatchNorm {
    type State = (
        FloatTensor<B>,
        [FloatTensor<B>; 2],
        [FloatTensor<B>; 2],
        f64,
        bool,
    );

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (x, parameters, statistics, epsilon, relu) = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        let gradients = B::batch_norm_grad(x, parameters, statistics, grad, epsilon, relu);
        for (node, grad) in ops.parents.into_iter().zip(gradients) {
            if let Some(node) = node {
                grads.register::<B>(node.id, grad);
            }
        }
    }
}

#[derive(Debug)]
struct Depthwise;

impl<B: KernelBackward> Backward<B, 2> for Depthwise {
    type State = (FloatTensor<B>, FloatTensor<B>, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (x, weight, dilation) = ops.state;
        let [x_node, weight_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        if let Some(node) = weight_node {
            let shape = weight.shape().dims();
            let grad = B::depthwise_grad_weight(x, grad.clone(), shape, dilation);
            grads.register::<B>(node.id, grad);
        }
        if let Some(node) = x_node {
            grads.register::<B>(node.id, B::depthwise_grad_x(weight, grad, dilation));
        }
    }
}

#[derive(Debug)]
struct Gelu;

impl<B: KernelBackward> Backward<B, 1> for Gelu {
    type State = FloatTensor<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::gelu_grad(ops.state, grad));
        }
    }
}

#[derive(Debug)]
struct Elu;

impl<B: KernelBackward> Backward<B, 1> for Elu {
    type State = FloatTensor<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::elu_grad(ops.state, grad));
        }
    }
}

#[derive(Debug)]
struct UpsampleConcat;

impl<B: KernelBackward> Backward<B, 2> for UpsampleConcat {
    type State = usize;

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let grad = grads.consume::<B>(&ops.node);
        let gradients = B::upsample_concat_grad(grad, ops.state);
        for (node, grad) in ops.parents.into_iter().zip(gradients) {
            if let Some(node) = node {
                grads.register::<B>(node.id, grad);
            }
        }
    }
}

#[derive(Debug)]
struct Warp;

impl<B: KernelBackward> Backward<B, 2> for Warp {
    type State = (FloatTensor<B>, FloatTensor<B>);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (image, coords) = ops.state;
        let [image_node, coords_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        if let Some(node) = image_node {
            let grad = B::warp_grad_image(image.clone(), coords.clone(), grad.clone());
            grads.register::<B>(node.id, grad);
        }
        if let Some(node) = coords_node {
            grads.register::<B>(node.id, B::warp_grad_coords(image, coords, grad));
        }
    }
}

#[derive(Debug)]
struct LocalCorrelation;

impl<B: KernelBackward> Backward<B, 2> for LocalCorrelation {
    type State = (FloatTensor<B>, FloatTensor<B>, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (first, second, radius) = ops.state;
        let [first_node, second_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        if let Some(node) = first_node {
            let grad = B::local_correlation_grad_first(second, grad.clone(), radius);
            grads.register::<B>(node.id, grad);
        }
        if let Some(node) = second_node {
            let grad = B::local_correlation_grad_second(first, grad, radius);
            grads.register::<B>(node.id, grad);
        }
    }
}

#[derive(Debug)]
struct Project;

impl<B: KernelBackward> Backward<B, 3> for Project {
    type State = [FloatTensor<B>; 3];

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [disparity, homography, shift] = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        let gradients = B::project_grad(disparity, homography, shift, grad);
        for (node, grad) in ops.parents.into_iter().zip(gradients) {
            if let Some(node) = node {
                grads.register::<B>(node.id, grad);
            }
        }
    }
}

#[derive(Debug)]
struct Smoothness;

impl<B: KernelBackward> Backward<B, 1> for Smoothness {
    type State = (FloatTensor<B>, FloatTensor<B>);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (disparity, image) = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::smoothness_grad(disparity, image, grad));
        }
    }
}

#[derive(Debug)]
struct Photometric;

impl<B: KernelBackward> Backward<B, 1> for Photometric {
    type State = (FloatTensor<B>, FloatTensor<B>, f64);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        grads: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (a, b, alpha) = ops.state;
        let grad = grads.consume::<B>(&ops.node);
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::photometric_grad(a, b, grad, alpha));
        }
    }
}

impl<B, C> KernelOps for Autodiff<B, C>
where
    B: Backend + KernelOps + KernelBackward,
    C: CheckpointStrategy,
{
    fn kernel_depthwise(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        dilation: usize,
    ) -> FloatTensor<Self> {
        let ((x, x_node), (weight, weight_node)) = (x.into_parts(), weight.into_parts());
        let output = B::kernel_depthwise(x.clone(), weight.clone(), dilation);
        let nodes = [x_node, weight_node];
        record!(Depthwise, C, nodes, output, (x, weight, dilation))
    }

    fn kernel_gelu(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let output = B::kernel_gelu(x.clone());
        record!(Gelu, C, [node], output, x)
    }

    fn kernel_upsample_concat(x: FloatTensor<Self>, skip: FloatTensor<Self>) -> FloatTensor<Self> {
        let channels = x.shape()[1];
        let ((x, x_node), (skip, skip_node)) = (x.into_parts(), skip.into_parts());
        let output = B::kernel_upsample_concat(x, skip);
        record!(UpsampleConcat, C, [x_node, skip_node], output, channels)
    }

    fn kernel_conv2d(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        has_bias: bool,
        options: ConvOptions,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let ((x, x_node), (weight, weight_node)) = (x.into_parts(), weight.into_parts());
        let (bias, bias_node) = bias.into_parts();
        let size = x.shape().dims();
        let (output, kept) = B::kernel_conv2d(x, weight.clone(), bias, has_bias, options);
        let nodes = [x_node, weight_node, bias_node];
        let state = (kept.clone(), size, weight, options);
        let output = record!(Conv2d, C, nodes, output, state);
        (output, Self::from_inner(kept))
    }

    fn kernel_batch_norm(
        x: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        epsilon: f64,
        relu: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let ((x, x_node), (gamma, gamma_node)) = (x.into_parts(), gamma.into_parts());
        let (beta, beta_node) = beta.into_parts();
        let (output, mean, variance) =
            B::kernel_batch_norm(x.clone(), gamma.clone(), beta.clone(), epsilon, relu);
        let nodes = [x_node, gamma_node, beta_node];
        let statistics = [mean.clone(), variance.clone()];
        let state = (x, [gamma, beta], statistics, epsilon, relu);
        let output = record!(BatchNorm, C, nodes, output, state);
        (output, Self::from_inner(mean), Self::from_inner(variance))
    }

    fn kernel_running_statistics(
        mean: FloatTensor<Self>,
        variance: FloatTensor<Self>,
        batch_mean: FloatTensor<Self>,
        batch_variance: FloatTensor<Self>,
        momentum: f64,
        unbiased: f64,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let [mean, variance, batch_mean, batch_variance] =
            [mean, variance, batch_mean, batch_variance].map(|t| t.into_primitive());
        let (mean, variance) = B::kernel_running_statistics(
            mean,
            variance,
            batch_mean,
            batch_variance,
            momentum,
            unbiased,
        );
        (Self::from_inner(mean), Self::from_inner(variance))
    }

    fn kernel_elu(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let output = B::kernel_elu(x);
        let state = output.clone();
        record!(Elu, C, [node], output, state)
    }

    fn kernel_warp(image: FloatTensor<Self>, coords: FloatTensor<Self>) -> FloatTensor<Self> {
        let ((image, image_node), (coords, coords_node)) =
            (image.into_parts(), coords.into_parts());
        let output = B::kernel_warp(image.clone(), coords.clone());
        let nodes = [image_node, coords_node];
        record!(Warp, C, nodes, output, (image, coords))
    }

    fn kernel_local_correlation(
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        radius: usize,
    ) -> FloatTensor<Self> {
        let ((first, first_node), (second, second_node)) =
            (first.into_parts(), second.into_parts());
        let output = B::kernel_local_correlation(first.clone(), second.clone(), radius);
        let nodes = [first_node, second_node];
        record!(LocalCorrelation, C, nodes, output, (first, second, radius))
    }

    fn kernel_project(
        disparity: FloatTensor<Self>,
        homography: FloatTensor<Self>,
        shift: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (disparity, depth_node) = disparity.into_parts();
        let (homography, homography_node) = homography.into_parts();
        let (shift, shift_node) = shift.into_parts();
        let output = B::kernel_project(disparity.clone(), homography.clone(), shift.clone());
        let nodes = [depth_node, homography_node, shift_node];
        let state = [disparity, homography, shift];
        record!(Project, C, nodes, output, state)
    }

    fn kernel_in_view(coords: FloatTensor<Self>, height: usize, width: usize) -> FloatTensor<Self> {
        Self::from_inner(B::kernel_in_view(coords.into_primitive(), height, width))
    }

    fn kernel_smoothness(
        disparity: FloatTensor<Self>,
        image: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (disparity, node) = disparity.into_parts();
        let image = image.into_primitive();
        let output = B::kernel_smoothness(disparity.clone(), image.clone());
        record!(Smoothness, C, [node], output, (disparity, image))
    }

    fn kernel_photometric(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        alpha: f64,
    ) -> FloatTensor<Self> {
        let (a, node) = a.into_parts();
        let b = b.into_primitive();
        let output = B::kernel_photometric(a.clone(), b.clone(), alpha);
        record!(Photometric, C, [node], output, (a, b, alpha))
    }
}
