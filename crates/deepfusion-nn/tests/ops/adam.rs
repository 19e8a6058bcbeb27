//! The optimiser's step and the norm that clips its gradient.

use super::common::{assert_close, device, random};
use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;
use deepfusion_nn::ops;

/// Two steps of a parameter, and the norm that clips its gradient.
#[test]
fn adam_and_the_sum_of_squares() {
    let plain = device().inner();
    let (values, gradient) = (random([70_001], &plain), random([70_001], &plain));
    let mut tensors = vec![gradient.clone()];
    for count in 1..=14_usize {
        let sum = ops::sum_of_squares(&tensors).into_scalar::<f32>();
        let squares = tensors.iter().map(|tensor| {
            let squares = tensor.to_data();
            let squares = squares.iter::<f32>().map(|v| f64::from(v).powi(2));
            squares.sum::<f64>()
        });
        let exact: f64 = squares.sum();
        assert!(
            (f64::from(sum) / exact - 1.0).abs() < 1e-5,
            "{count} tensors: {sum} {exact}"
        );
        tensors.push(random([31 * count], &plain));
    }

    let run = |f: fn(&AdamStep, Tensor<1>, Tensor<1>, [Tensor<1>; 2]) -> _| {
        let moments = [values.zeros_like(), values.zeros_like()];
        let (mut values, mut moments): (Tensor<1>, [Tensor<1>; 2]) = (values.clone(), moments);
        for count in 1..=2 {
            let step = AdamStep {
                learning_rate: 0.01,
                beta1: 0.9,
                beta2: 0.999,
                epsilon: 1e-8,
                correction1: 1.0 - 0.9_f32.powi(count),
                correction2: 1.0 - 0.999_f32.powi(count),
                gradient_scale: 0.5,
                weight_decay: 0.1,
            };
            (values, moments) = f(&step, values, gradient.clone(), moments);
        }
        (values, moments)
    };
    let (values, [first, second]) = run(ops::adam);
    let (expected, [expected_first, expected_second]) = run(ops::composed_adam);
    assert_close("values", values, expected);
    assert_close("first moment", first, expected_first);
    assert_close("second moment", second, expected_second);
}
