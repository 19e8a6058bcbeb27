//! Two-dimensional convolution as tiles of im2col and matrix products.
//!
//! With K = C_in·kh·kw, the weights are an O×K matrix W and the unfolded input a K×P matrix X of the
//! P = N·H_out·W_out output pixels. Then
//! - forward: Y = W·X + b,
//! - weight gradient: ∂W = ∂Y·Xᵀ,
//! - input gradient: ∂X = Wᵀ·∂Y, folded back.
//!
//! X is never whole: a tile of output rows is unfolded, used and forgotten while it is in the cache.
//! Where an image has few pixels (deep layers), a tile spans several images, so that the weights are
//! read once for all of them.

mod backward;
mod forward;
mod shape;
mod tile;
mod unfold;

pub use backward::{conv2d_backward_input, conv2d_backward_weight};
pub use forward::conv2d;
pub use shape::ConvShape;

#[cfg(test)]
mod tests;
