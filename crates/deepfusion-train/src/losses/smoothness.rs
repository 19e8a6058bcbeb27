//! Edge-aware smoothness (Eq. 8); the operation itself is in `deepfusion-nn`.

pub use deepfusion_nn::ops::smoothness;

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, Distribution, Tensor};

    #[test]
    fn a_flat_disparity_is_smooth_and_the_scale_does_not_matter() {
        let device = Device::flex();
        let image = Tensor::<4>::random([1, 3, 6, 8], Distribution::Uniform(0.0, 1.0), &device);
        let flat = Tensor::<4>::full([1, 1, 6, 8], 0.3, &device);
        assert!(smoothness(flat, image.clone()).into_scalar::<f32>().abs() < 1e-6);
        let rough = Tensor::<4>::random([1, 1, 6, 8], Distribution::Uniform(0.1, 1.0), &device);
        let a = smoothness(rough.clone(), image.clone()).into_scalar::<f32>();
        let b = smoothness(rough.mul_scalar(7.0), image).into_scalar::<f32>();
        assert!(a > 0.1 && (a - b).abs() < 1e-5, "{a} {b}");
    }

    #[test]
    fn a_disparity_edge_costs_less_at_an_image_edge() {
        let device = Device::flex();
        let step = |low: f32, high: f32| {
            let row = [low, low, low, high, high, high];
            Tensor::<2>::from_data([row; 4], &device).reshape([1, 1, 4, 6])
        };
        let disparity = step(0.2, 0.6);
        let plain = smoothness(disparity.clone(), Tensor::zeros([1, 3, 4, 6], &device));
        let edged = smoothness(disparity, step(0.0, 1.0).expand([1, 3, 4, 6]));
        let ratio = edged.into_scalar::<f32>() / plain.into_scalar::<f32>();
        assert!((ratio - (-1.0_f32).exp()).abs() < 1e-5, "{ratio}");
    }

    /// Random values are away from the kinks of |·|: neighbours differ by more than the step 1e-3.
    /// f32 central differences of a function of order 1 are good to about 1e-3.
    #[test]
    fn gradient_equals_finite_differences() {
        let device = Device::flex().autodiff();
        let image = Tensor::<4>::from_data(
            [[[[0.1, 0.7, 0.3], [0.9, 0.2, 0.5], [0.4, 0.8, 0.6]]]],
            &device,
        );
        let point = [0.31, 0.52, 0.13, 0.84, 0.45, 0.27, 0.68, 0.19, 0.75];
        let loss = |values: [f32; 9]| {
            let d = Tensor::<1>::from_data(values, &device).require_grad();
            let loss = smoothness(d.clone().reshape([1, 1, 3, 3]), image.clone());
            (d, loss)
        };
        let (d, value) = loss(point);
        let gradient: Vec<f32> = d
            .grad(&value.backward())
            .unwrap()
            .into_data()
            .try_into_vec()
            .unwrap();
        for i in 0..9 {
            let at = |step: f32| {
                let mut moved = point;
                moved[i] += step;
                loss(moved).1.into_scalar::<f32>()
            };
            let numeric = (at(1e-3) - at(-1e-3)) / 2e-3;
            assert!(
                (numeric - gradient[i]).abs() < 2e-3,
                "{i}: {numeric} {}",
                gradient[i]
            );
        }
    }
}
