use crate::Motion;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use deepfusion_nn::ops;

/// Points nearer than this to the camera's plane, in metres, have no pixel (SPEC 2, Eq. 5).
const MIN_DEPTH_M: f64 = 1e-3;

/// Sees a source image from the target's place (Eq. 3–5).
#[derive(Debug, Clone)]
pub struct ViewSynthesis {
    /// Homogeneous pixel coordinates, 1×3×(H·W).
    pixels: Tensor<3>,
    height: usize,
    width: usize,
}

/// A source seen from the target.
#[derive(Debug, Clone)]
pub struct Synthesised {
    /// Î, N×C×H×W; border-padded where out of view.
    pub image: Tensor<4>,
    /// Where the pixel lies in front of the source camera and inside its image, N×1×H×W.
    pub valid: Tensor<4, Bool>,
}

impl ViewSynthesis {
    /// For images of `height` × `width`.
    #[must_use]
    pub fn new(height: usize, width: usize, device: &Device) -> Self {
        let area = height * width;
        let mut pixels = vec![1.0_f32; 3 * area];
        for y in 0..height {
            for x in 0..width {
                pixels[y * width + x] = x as f32;
                pixels[area + y * width + x] = y as f32;
            }
        }
        Self {
            pixels: Tensor::from_data(TensorData::new(pixels, [1, 3, area]), device),
            height,
            width,
        }
    }

    /// Î(p) = source⟨p'⟩, p' ~ K·(R·D(p)·K⁻¹·p̃ + t).
    ///
    /// # Shapes
    /// - `source`: `[N, C, H, W]`
    /// - `target_depth_m`: `[N, 1, H, W]`, metres
    /// - `source_from_target`: N motions
    /// - `intrinsics`, `inverse_intrinsics`: `[N, 3, 3]`, in pixels of these images
    #[must_use]
    pub fn forward(
        &self,
        source: Tensor<4>,
        target_depth_m: Tensor<4>,
        source_from_target: &Motion,
        intrinsics: &Tensor<3>,
        inverse_intrinsics: &Tensor<3>,
    ) -> Synthesised {
        let [n, _, height, width] = target_depth_m.dims();
        let area = height * width;
        // p' ~ (K·R·K⁻¹·p̃)·D + K·t: the 3×3 products are taken once, not at every pixel.
        let homography = intrinsics
            .clone()
            .matmul(source_from_target.rotation.clone())
            .matmul(inverse_intrinsics.clone());
        let shift = intrinsics
            .clone()
            .matmul(source_from_target.translation.clone().reshape([n, 3, 1]));
        let pixels = self.pixels.clone().expand([n, 3, area]);
        let projected = homography
            .matmul(pixels)
            .mul(target_depth_m.reshape([n, 1, area]))
            .add(shift);
        let z = projected.clone().narrow(1, 2, 1);
        let in_front = z.clone().greater_elem(MIN_DEPTH_M);
        let coords = projected
            .narrow(1, 0, 2)
            .div(z.clamp_min(MIN_DEPTH_M))
            .reshape([n, 2, height, width]);
        let valid = self
            .in_view(coords.clone().detach())
            .bool_and(in_front.reshape([n, 1, height, width]));
        Synthesised {
            image: ops::warp(source, coords),
            valid,
        }
    }

    fn in_view(&self, coords: Tensor<4>) -> Tensor<4, Bool> {
        let inside = |axis: usize, size: usize| {
            let p = coords.clone().narrow(1, axis, 1);
            p.clone()
                .greater_equal_elem(0.0)
                .bool_and(p.lower_equal_elem((size - 1) as f64))
        };
        inside(0, self.width).bool_and(inside(1, self.height))
    }
}
