use crate::{CompareAt, ForwardPass};
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor};
use deepfusion_nn::{SCALES, ops};

/// Images and cameras at one of the sizes at which views are compared.
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
    /// Photometric error of the unwarped sources (the automask's baseline), by view, T×1×H×W, without gradient.
    pub(crate) unwarped: Vec<Tensor<4>>,
}

impl Level {
    fn new(
        targets: Tensor<4>,
        sources: Vec<Tensor<4>>,
        (intrinsics, inverse_intrinsics): (Tensor<3>, Tensor<3>),
        ssim_weight: f64,
    ) -> Self {
        let unwarped = sources.iter().map(|source| {
            ops::photometric_error(source.clone(), targets.clone(), ssim_weight).detach()
        });
        Self {
            unwarped: unwarped.collect(),
            targets,
            sources,
            intrinsics,
            inverse_intrinsics,
        }
    }
}

/// The level of every scale of the decoder; `targets` are the batch's at these scales.
pub(crate) fn levels(
    pass: &ForwardPass,
    targets: &[Tensor<4>],
    compare_at: CompareAt,
    ssim_weight: f64,
) -> Vec<Level> {
    if compare_at == CompareAt::Full {
        let cameras = (pass.intrinsics.clone(), pass.inverse_intrinsics.clone());
        let sources = pass.sources.clone();
        let full = Level::new(targets[0].clone(), sources, cameras, ssim_weight);
        return vec![full; SCALES];
    }
    let sources: Vec<_> = pass.sources.iter().cloned().map(pyramid).collect();
    let scales = targets.iter().enumerate().map(|(scale, targets)| {
        let sources = sources.iter().map(|source| source[scale].clone());
        let cameras = cameras(pass, scale);
        Level::new(targets.clone(), sources.collect(), cameras, ssim_weight)
    });
    scales.collect()
}

/// K and K⁻¹ of images at 1/2ˢ of their size: f' = s·f and c' = s·(c + ½) − ½, as matrices.
fn cameras(pass: &ForwardPass, scale: usize) -> (Tensor<3>, Tensor<3>) {
    let [count, _, _] = pass.intrinsics.dims();
    let device = pass.intrinsics.device();
    let factor = 1.0 / f64::from(1_u32 << scale);
    let shrink = resizing(factor, &device).expand([count, 3, 3]);
    let grow = resizing(1.0 / factor, &device).expand([count, 3, 3]);
    (
        shrink.matmul(pass.intrinsics.clone()),
        pass.inverse_intrinsics.clone().matmul(grow),
    )
}

/// Maps pixel coordinates of an image to those of the image resized by `factor`, 1×3×3.
fn resizing(factor: f64, device: &Device) -> Tensor<3> {
    let (scale, shift) = (factor as f32, (0.5 * (factor - 1.0)) as f32);
    let matrix = [[scale, 0.0, shift], [0.0, scale, shift], [0.0, 0.0, 1.0]];
    Tensor::from_data([matrix], device)
}

/// The image at every scale of the decoder: each pixel is the mean of a 2×2 block of the scale before.
pub(crate) fn pyramid(image: Tensor<4>) -> Vec<Tensor<4>> {
    let mut images = vec![image];
    for scale in 1..SCALES {
        let options = AvgPoolOptions::new([2, 2]).with_stride([2, 2]);
        images.push(avg_pool2d(images[scale - 1].clone(), options));
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::Intrinsics;

    /// The matrix agrees with resizing the camera.
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
