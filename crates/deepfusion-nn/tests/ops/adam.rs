//! The optimiser's step and the norm that clips its gradient.

use super::common::{assert_close, device, random};
use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;
use deepfusion_nn::ops::{self, AdamFactors};

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

    let run = |f: fn(&AdamStep, &AdamFactors, Tensor<1>, Tensor<1>, [Tensor<1>; 2]) -> _| {
        let moments = [values.zeros_like(), values.zeros_like()];
        let (mut values, mut moments): (Tensor<1>, [Tensor<1>; 2]) = (values.clone(), moments);
        for count in 1..=2 {
            let step = step(count);
            let factors = AdamFactors::of(&step, &plain);
            (values, moments) = f(&step, &factors, values, gradient.clone(), moments);
        }
        (values, moments)
    };
    let (values, [first, second]) = run(ops::adam);
    let (expected, [expected_first, expected_second]) = run(ops::composed_adam);
    assert_close("values", values, expected);
    assert_close("first moment", first, expected_first);
    assert_close("second moment", second, expected_second);
}

fn step(count: i32) -> AdamStep {
    AdamStep {
        learning_rate: 0.01,
        beta1: 0.9,
        beta2: 0.999,
        epsilon: 1e-8,
        correction1: 1.0 - 0.9_f32.powi(count),
        correction2: 1.0 - 0.999_f32.powi(count),
        gradient_scale: 0.5,
        weight_decay: 0.1,
    }
}

/// A step works with factors that were computed on the device. A step that is not made changes nothing, whatever its gradient is.
#[test]
fn the_device_may_decide_about_a_step() {
    let plain = device().inner();
    let values = random([1_031], &plain);
    let moments = [random([1_031], &plain), random([1_031], &plain)].map(Tensor::abs);
    let step = step(3);
    let decided = |norm: f32| {
        let is_made = Tensor::<1>::from_data([norm], &plain).is_finite().all();
        let scale = Tensor::from_data([step.gradient_scale], &plain);
        let corrections = Tensor::from_data([step.correction1, step.correction2], &plain);
        AdamFactors::decided(scale, corrections, is_made)
    };
    let read = |t: Tensor<1>| -> Vec<f32> { t.into_data().iter().collect() };
    for f in [ops::adam, ops::composed_adam] {
        let made = |factors: &AdamFactors, gradient: &Tensor<1>| {
            let (values, [first, second]) = f(
                &step,
                factors,
                values.clone(),
                gradient.clone(),
                moments.clone(),
            );
            [values, first, second].map(read)
        };
        let gradient = random([1_031], &plain);
        let known = made(&AdamFactors::of(&step, &plain), &gradient);
        assert_eq!(made(&decided(1.0), &gradient), known);
        let before = [&values, &moments[0], &moments[1]].map(|t| read(t.clone()));
        assert_ne!(known[0], before[0]);
        for broken in [f32::NAN, f32::INFINITY] {
            let gradient = Tensor::full([1_031], broken, &plain);
            assert_eq!(made(&decided(broken), &gradient), before, "{broken}");
        }
    }
}
