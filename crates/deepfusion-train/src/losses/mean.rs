use burn::tensor::{Bool, Tensor};

/// Σ values / Σ weights of each image, averaged over the images; an image whose weights are 0 gives 0, not NaN. The values are 0 where the
/// weights are.
///
/// Each image has the same weight, however many of its pixels count. So a batch's loss is the mean of its parts' losses, and K workers with
/// batches of B learn the same as one worker with a batch of K·B.
///
/// # Shapes
/// - `values`: `[N, C, H, W]`
/// - `weights`: `[N, 1, H, W]`, shared by all channels
pub(super) fn mean_over(values: Tensor<4>, weights: Tensor<4>) -> Tensor<1> {
    let [_, channels, _, _] = values.dims();
    let count = of_image(weights).clamp_min(1.0);
    of_image(values)
        .div(count.mul_scalar(channels as f64))
        .mean()
}

/// [`mean_over`] the pixels where the mask is true. Values elsewhere are ignored, even NaN.
pub(super) fn mean_where(values: Tensor<4>, mask: &Tensor<4, Bool>) -> Tensor<1> {
    let outside = mask.clone().bool_not().expand(values.dims());
    mean_over(values.mask_fill(outside, 0.0), mask.clone().float())
}

/// Sums of the images, N×1×1×1.
fn of_image(values: Tensor<4>) -> Tensor<4> {
    values.sum_dim(3).sum_dim(2).sum_dim(1)
}

/// The share of true pixels, one value.
#[must_use]
pub fn share(mask: &Tensor<4, Bool>) -> Tensor<1> {
    mask.clone().float().mean()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn only_true_pixels_count_and_without_any_the_mean_is_zero() {
        let device = Device::flex();
        let values = Tensor::<4>::from_data([[[[1.0, f32::NAN]], [[3.0, 9.0]]]], &device);
        let mask = Tensor::<4>::from_data([[[[1.0, 0.0]]]], &device);
        let first = mask.clone().greater_elem(0.5);
        let mean = mean_where(values.clone(), &first).into_scalar::<f32>();
        assert!((mean - 2.0).abs() < 1e-6, "{mean}");
        assert!((share(&first).into_scalar::<f32>() - 0.5).abs() < 1e-6);
        let none = mask.greater_elem(2.0);
        assert_eq!(mean_where(values, &none).into_scalar::<f32>(), 0.0);
    }

    /// One image has one valid pixel, the other three.
    #[test]
    fn images_have_equal_weight_however_many_pixels_count() {
        let device = Device::flex();
        let values = Tensor::<4>::from_data([[[[6.0, 9.0, 9.0]]], [[[1.0, 2.0, 3.0]]]], &device);
        let mask = Tensor::<4>::from_data([[[[1.0, 0.0, 0.0]]], [[[1.0; 3]]]], &device);
        let mean = mean_where(values, &mask.greater_elem(0.5)).into_scalar::<f32>();
        assert!((mean - 4.0).abs() < 1e-6, "{mean}");
    }

    /// An image without valid pixels adds nothing to the mean or its gradient, and does not enlarge the other image's gradient.
    #[test]
    fn an_image_without_valid_pixels_counts_as_zero() {
        let device = Device::flex().autodiff();
        let values = Tensor::<4>::from_data([[[[2.0, 4.0]]], [[[f32::NAN, 5.0]]]], &device);
        let values = values.require_grad();
        let mask = Tensor::<4>::from_data([[[[1.0, 1.0]]], [[[0.0, 0.0]]]], &device);
        let mean = mean_where(values.clone(), &mask.greater_elem(0.5));
        assert!((mean.clone().into_scalar::<f32>() - 1.5).abs() < 1e-6);
        let gradient = values.grad(&mean.backward()).unwrap().into_data();
        let gradient: Vec<f32> = gradient.iter().collect();
        assert_eq!(gradient, [0.25, 0.25, 0.0, 0.0]);
    }
}
