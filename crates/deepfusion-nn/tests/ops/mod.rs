//! The kernels as differentiable operations against the same operations composed of Burn's: values and gradients. On the CPU or, with the
//! feature `vulkan`, `wgpu`, `cuda` or `metal`, on a GPU.

mod adam;
mod batch_norm;
mod common;
mod convolution;
mod pointwise;
mod resizing;
mod views;
