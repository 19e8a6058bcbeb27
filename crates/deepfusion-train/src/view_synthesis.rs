use crate::Motion;
use burn::tensor::{Bool, Tensor};
use deepfusion_nn::ops;

/// A source warped to the target.
#[derive(Debug, Clone)]
pub struct Synthesised {
    /// Î, N×C×H×W; border-padded where out of view.
    pub image: Tensor<4>,
    /// p', where each pixel of the target lies in the source, N×2×H×W, in pixels.
    pub coords: Tensor<4>,
    /// Where the pixel lies in front of the source camera and inside its image, N×1×H×W.
    pub valid: Tensor<4, Bool>,
}

/// Warps a source image to the target's view (the paper's Eq. 3–5): Î(p) = source⟨p'⟩, p' ~
/// K·(R·D(p)·K⁻¹·p̃ + t).
///
/// # Shapes
/// - `source`: `[N, C, H, W]`
/// - `target_disparity`: `[N, 1, H, W]`, 1/m
/// - `source_from_target`: N motions
/// - `intrinsics`, `inverse_intrinsics`: `[N, 3, 3]`, in pixels of these images
#[must_use]
pub fn synthesise(
    source: Tensor<4>,
    target_disparity: Tensor<4>,
    source_from_target: &Motion,
    intrinsics: &Tensor<3>,
    inverse_intrinsics: &Tensor<3>,
) -> Synthesised {
    let [n, _, height, width] = source.dims();
    let homography = intrinsics
        .clone()
        .matmul(source_from_target.rotation.clone())
        .matmul(inverse_intrinsics.clone());
    let translation = source_from_target.translation.clone().reshape([n, 3, 1]);
    let shift = intrinsics.clone().matmul(translation).reshape([n, 3]);
    let coords = ops::project(target_disparity, homography, shift);
    Synthesised {
        valid: ops::in_view(coords.clone(), [height, width]),
        image: ops::warp(source, coords.clone()),
        coords,
    }
}
