use burn::tensor::{Bool, Tensor};

/// The mean of the values where the mask is true; 0, not NaN, if it is true nowhere.
///
/// # Shapes
/// - `values`: `[N, C, H, W]`
/// - `mask`: `[N, 1, H, W]`; the mean is over its pixels and all channels
pub(super) fn mean_where(values: Tensor<4>, mask: &Tensor<4, Bool>) -> Tensor<1> {
    let [_, channels, _, _] = values.dims();
    let count = mask.clone().float().sum().clamp_min(1.0);
    let outside = mask.clone().bool_not().expand(values.dims());
    values
        .mask_fill(outside, 0.0)
        .sum()
        .div(count.mul_scalar(channels as f64))
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
    fn only_true_pixels_count_and_none_is_zero() {
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
}
