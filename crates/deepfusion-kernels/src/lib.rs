//! Numeric kernels of the networks on plain slices, forward and backward: convolution, bilinear warp, local correlation, photometric error,
//! batch normalisation, activations, depthwise convolution; and resizing of an image's bytes.
//!
//! Independent of Burn. Images are N×C×H×W, contiguous. Work is distributed over rayon's threads, and every result is independent of their
//! number.

mod activation;
mod adam;
mod batch_norm;
mod box_filter;
mod conv;
mod correlation;
mod depthwise;
mod gelu;
mod lanes;
#[cfg(target_arch = "x86_64")]
pub mod matrix_unit;
mod photometric;
mod position;
mod project;
mod resize;
mod scratch;
mod send_ptr;
mod sizes;
mod slot;
mod smoothness;
mod upsample;
mod warp;
pub mod winograd;

#[cfg(test)]
mod noise;

pub use activation::{channel_sums, elu, elu_backward};
pub use adam::{AdamStep, adam, sum_of_squares};
pub use batch_norm::{BatchNormSaved, batch_norm, batch_norm_backward};
pub use conv::{
    ConvShape, Precision, conv2d, conv2d_backward_input, conv2d_backward_weight, has_bf16,
};
pub use correlation::{
    CorrelationShape, local_correlation, local_correlation_backward_first,
    local_correlation_backward_second,
};
pub use depthwise::{
    DepthwiseShape, depthwise, depthwise_backward_input, depthwise_backward_weight,
};
pub use gelu::{GELU_END, GELU_SERIES, gelu, gelu_backward, gelu_exact};
pub use photometric::{
    PhotometricShape, SSIM_C1, SSIM_C2, photometric_error, photometric_error_backward,
};
pub use position::position_code;
pub use project::{MIN_DEPTH_M, NOWHERE, ProjectGradients, in_view, project, project_backward};
pub use resize::{Filter, Resizer};
pub use slot::Slot;
pub use smoothness::{SmoothnessShape, smoothness, smoothness_backward};
pub use upsample::{upsample_concat, upsample_concat_backward};
pub use warp::{WarpFloat, WarpShape, warp, warp_backward_coords, warp_backward_image};
