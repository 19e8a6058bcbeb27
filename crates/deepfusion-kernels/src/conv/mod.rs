//! Two-dimensional convolution and its gradients, without im2col.
//!
//! A tile of the input is copied once, padded, into planes in which every tap of the kernel is a shift
//! ([`lattice`]); one register-blocked loop then reads it through a table of offsets ([`product`]):
//! - forward: Y\[o, q\] = b\[o\] + Σ_k W\[o, k\]·X\[q + offset k\],
//! - input gradient: the same over ∂Y with transposed weights; with stride s, one such product for each of the s×s remainders of the
//!   input's rows and columns,
//! - weight gradient: ∂W\[o, k\] = Σ_q ∂Y\[o, q\]·X\[q + offset k\].
//!
//! All three use [another form](winograd) if kernels are 3×3 and the images large enough.
//!
//! In [`Precision::Bf16`] the planes contain pairs, which other loops multiply ([`bf16`]).
//!
//! Tiles are sized for the L2 cache. If an image has few pixels (deep layers), a tile contains several images, so that the weights are read
//! once for all of them.

mod arithmetic;
mod bf16;
mod few_outputs;
mod forward;
mod input_gradient;
mod lattice;
mod product;
mod shape;
mod transpose;
mod weight_gradient;
mod winograd;

pub use bf16::{Precision, has_bf16};
pub use forward::conv2d;
pub use input_gradient::conv2d_backward_input;
pub use shape::ConvShape;
pub use weight_gradient::conv2d_backward_weight;

#[cfg(test)]
mod tests;
