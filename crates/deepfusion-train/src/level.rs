use crate::ForwardPass;
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor};
use deepfusion_nn::{SCALES, ops};

/// The images and cameras at which views are compared.
#[derive(Debug, Clone)]
pub(crate) struct Level {
    /// Targets, T×3×H×W.
    pub(crate) targets: Tensor<4>,
    /// Sources by view, T×3×H×W.
    pub(crate) sources: Vec<Tensor<4>>,
    /// K of these images, T×3×3.
    pub(crate) intrinsics: Tensor<3>,
    /// K⁻¹.
    pub(crate) inverse_intrinsics: Tensor<3>,
    /// What standing still would explain, by view, T×1×H×W, without gradient.
    pub(crate) unwarped: Vec<Tensor<4>>,
}

impl Level {
    /// Scale s of a batch: its images at 1/2ˢ of their size.
    pub(crate) fn at(pass: &ForwardPass, scale: usize, ssim_weight: f64) -> Self {
        let image = |t: &Tensor<4>| half(t.clone().detach(), scale);
        let targets = image(&pass.targets);
        let sources: Vec<_> = pass.sources.iter().map(image).collect();
        let unwarped = sources.iter().map(|source| {
            ops::photometric_error(source.clone(), targets.clone(), ssim_weight).detach()
        });
        let unwarped = unwarped.collect();
        let device = pass.intrinsics.device();
        // f' = s·f and c' = s·(c + ½) − ½ (SPEC 0), as matrices.
        let factor = 1.0 / f64::from(1_u32 << scale);
        let shrink = resizing(factor, &device);
        let grow = resizing(1.0 / factor, &device);
        let [count, _, _] = pass.intrinsics.dims();
        Self {
            targets,
            sources,
            intrinsics: shrink.expand([count, 3, 3]).matmul(pass.intrinsics.clone()),
            inverse_intrinsics: pass
                .inverse_intrinsics
                .clone()
                .matmul(grow.expand([count, 3, 3])),
            unwarped,
        }
    }
}

/// Takes pixels of an image to those of the image resized by `factor`, 1×3×3.
#[allow(clippy::cast_possible_truncation)]
fn resizing(factor: f64, device: &Device) -> Tensor<3> {
    let (scale, shift) = (factor as f32, (0.5 * (factor - 1.0)) as f32);
    let matrix = [[scale, 0.0, shift], [0.0, scale, shift], [0.0, 0.0, 1.0]];
    Tensor::from_data([matrix], device)
}

/// The image halved `times` times by the mean of 2×2 blocks.
pub(crate) fn half(image: Tensor<4>, times: usize) -> Tensor<4> {
    (0..times).fold(image, |image, _| {
        let options = AvgPoolOptions::new([2, 2]).with_stride([2, 2]);
        avg_pool2d(image, options)
    })
}

/// The image at every scale of the decoder.
pub(crate) fn pyramid(image: Tensor<4>) -> Vec<Tensor<4>> {
    let mut images = vec![image];
    for scale in 1..SCALES {
        images.push(half(images[scale - 1].clone(), 1));
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::Intrinsics;

    /// Halving the image and halving the camera mean the same.
    #[test]
    fn the_matrix_resizes_the_camera() {
        let device = Device::flex();
        let k = Intrinsics {
            fx: 700.0,
            fy: 710.0,
            cx: 319.0,
            cy: 90.0,
            width: 640,
            height: 192,
        };
        let expected = k.resized(160, 48).matrix();
        let rows: [[f32; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| k.matrix()[(i, j)] as f32));
        let resized = resizing(0.25, &device).matmul(Tensor::from_data([rows], &device));
        let resized: Vec<f32> = resized.into_data().try_into_vec().unwrap();
        for (i, value) in resized.iter().enumerate() {
            let expected = expected[(i / 3, i % 3)];
            assert!((f64::from(*value) - expected).abs() < 1e-3, "{i}: {value}");
        }
    }
}
