//! The flow decoder against PyTorch: flows in both directions at every size, and the gradients of the encoder's features and of all
//! weights.
//!
//! The reference (tests/reference/flow_decoder.py) is in double precision, so the difference is float32 rounding. Tolerance: 1e-4 of each
//! tensor's root mean square; the largest measured error of 38 tensors is 9.0e-6.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use crate::networks::common::{formula, largest_difference, reference, uniform};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::weights::{self, WeightTensor, Weights};
use deepfusion_nn::{FlowDecoder, FlowDecoderConfig, FlowOutput, WeightRng};

/// Relative to a tensor's root mean square.
const TOLERANCE: f32 = 1e-4;
const CHANNELS: [usize; 5] = [4, 12, 20, 28, 36];
const BATCH: usize = 2;
const HEIGHT: usize = 64;
const WIDTH: usize = 96;

fn decoder(device: &Device) -> FlowDecoder {
    let config = FlowDecoderConfig {
        radius: 4,
        feature_width: 16,
        widths: vec![24, 20],
    };
    let decoder = FlowDecoder::new(&config, CHANNELS, &mut WeightRng::new(0), device);
    let decoder = decoder.unwrap();
    let mut by_formula = Weights::new("the formula");
    for (name, tensor) in weights::collect(&decoder).tensors {
        let values = formula(&name, &tensor.shape, None);
        let shape = tensor.shape;
        let tensor = WeightTensor { shape, values };
        by_formula.tensors.insert(name, tensor);
    }
    weights::apply(decoder, &by_formula).unwrap()
}

fn leaf(name: &str, shape: [usize; 4], device: &Device) -> Tensor<4> {
    let values = uniform(name, shape.iter().product(), None);
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn features(name: &str, device: &Device) -> [Tensor<4>; 5] {
    std::array::from_fn(|k| {
        let shape = [BATCH, CHANNELS[k], HEIGHT >> (k + 1), WIDTH >> (k + 1)];
        leaf(&format!("{name}{k}"), shape, device).require_grad()
    })
}

/// Compares tensors with the reference's and remembers the largest error.
struct Comparison {
    expected: Weights,
    compared: usize,
    largest: (f32, String),
}

impl Comparison {
    fn check(&mut self, name: &str, actual: Tensor<4>) {
        self.check_values(name, &actual.into_data().try_into_vec().unwrap());
    }

    fn check_values(&mut self, name: &str, actual: &[f32]) {
        let step = match actual.len() {
            0..=400 => 1,
            len => (len / 400) | 1,
        };
        let (difference, rms) = largest_difference(&self.expected, name, actual, step);
        let error = difference / rms;
        self.compared += 1;
        if error > self.largest.0 {
            self.largest = (error, name.to_owned());
        }
        assert!(error < TOLERANCE, "{name}: {error:e}");
    }
}

fn compare(both: impl Fn(&FlowDecoder, &[Tensor<4>; 5], &[Tensor<4>; 5]) -> [FlowOutput; 2]) {
    let device = Device::flex().autodiff();
    let decoder = decoder(&device);
    let frames = ["first", "second"].map(|name| (name, features(name, &device)));
    let mut comparison = Comparison {
        expected: weights::read(&reference("flow_decoder.safetensors")).unwrap(),
        compared: 0,
        largest: (0.0, String::new()),
    };
    let outputs = both(&decoder, &frames[0].1, &frames[1].1);
    let mut loss = Tensor::<1>::zeros([1], &device);
    for (direction, output) in ["there", "back"].into_iter().zip(outputs) {
        for (level, flow) in output.levels.into_iter().enumerate() {
            comparison.check(&format!("{direction}/level{level}"), flow);
        }
        comparison.check(&format!("{direction}/flow"), output.flow.clone());
        let shape = output.flow.dims();
        let pattern = leaf(&format!("{direction}/pattern"), shape, &device);
        loss = loss + output.flow.mul(pattern).sum();
    }
    let gradients = loss.backward();
    for (name, features) in &frames {
        for k in [1, 2, 3] {
            let gradient = features[k].grad(&gradients).unwrap();
            comparison.check(&format!("{name}{k}"), gradient);
        }
    }
    for (index, level) in decoder.levels.iter().enumerate() {
        let mut convolutions = vec![
            ("project".to_owned(), &level.project),
            ("output".to_owned(), &level.output),
        ];
        for (index, conv) in level.hidden.iter().enumerate() {
            convolutions.push((format!("hidden.{index}"), conv));
        }
        for (name, conv) in convolutions {
            let name = format!("levels.{index}.{name}");
            let weight = conv.weight.val().grad(&gradients).unwrap();
            comparison.check(&format!("{name}.weight"), weight);
            let bias = conv.bias.as_ref().unwrap().val().grad(&gradients).unwrap();
            let bias: Vec<f32> = bias.into_data().try_into_vec().unwrap();
            comparison.check_values(&format!("{name}.bias"), &bias);
        }
    }
    let (error, name) = &comparison.largest;
    println!("largest of {}: {error:.1e} ({name})", comparison.compared);
    let all = comparison.expected.tensors.len();
    assert_eq!(comparison.compared, all, "every reference is used");
}

#[test]
fn one_direction_after_the_other_is_pytorchs() {
    compare(|decoder, first, second| {
        [
            decoder.forward(first, second),
            decoder.forward(second, first),
        ]
    });
}

#[test]
fn both_directions_at_once_are_pytorchs() {
    compare(FlowDecoder::forward_both);
}
