//! The operations and their gradients against PyTorch, for random shapes, strides, paddings and dilations.
//!
//! The reference (tests/reference/operations.py) is in double precision, so the difference is float32 rounding. Tolerance: 1e-4 of each
//! tensor's root mean square; the largest measured error of 260 tensors is 4.9e-6.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use crate::networks::common::{largest_difference, reference, uniform};
use burn::tensor::{Device, Tensor};
use deepfusion_nn::ops::{self, ConvOptions};
use deepfusion_nn::weights;
use serde::Deserialize;

/// Relative to a tensor's root mean square.
const TOLERANCE: f32 = 1e-4;
/// Most values of a tensor that the reference keeps.
const AT_MOST: usize = 400;

#[derive(Deserialize)]
struct Case {
    name: String,
    operation: String,
    /// Name, shape, scale and offset.
    inputs: Vec<(String, Vec<usize>, f32, f32)>,
    options: Options,
}

/// Parameters of all operations; each operation uses its own.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Options {
    stride: usize,
    padding: usize,
    dilation: usize,
    reflect: bool,
    relu: bool,
    alpha: f64,
    radius: usize,
}

/// An input as a leaf of the graph.
struct Input {
    leaf: Tensor<1>,
    shape: Vec<usize>,
}

impl Input {
    fn tensor<const D: usize>(&self) -> Tensor<D> {
        let shape: [usize; D] = self.shape.clone().try_into().unwrap();
        self.leaf.clone().reshape(shape)
    }
}

fn run(case: &Case, inputs: &[Input]) -> Tensor<4> {
    let options = &case.options;
    match (case.operation.as_str(), inputs) {
        ("conv2d", [x, weight, bias @ ..]) => {
            let options = ConvOptions {
                stride: options.stride,
                padding: options.padding,
                dilation: options.dilation,
                reflect: options.reflect,
                ..ConvOptions::default()
            };
            let bias = bias.first().map(Input::tensor);
            ops::conv2d(x.tensor(), weight.tensor(), bias, options)
        }
        ("warp", [image, coords]) => ops::warp(image.tensor(), coords.tensor()),
        ("local_correlation", [a, b]) => {
            ops::local_correlation(a.tensor(), b.tensor(), options.radius)
        }
        ("photometric", [a, b]) => ops::photometric_error(a.tensor(), b.tensor(), options.alpha),
        ("batch_norm", [x, gamma, beta]) => {
            ops::batch_norm(
                x.tensor(),
                gamma.tensor(),
                beta.tensor(),
                1e-5,
                options.relu,
            )
            .output
        }
        ("elu", [x]) => ops::elu(x.tensor()),
        ("upsample_concat", [x, skip @ ..]) => {
            ops::upsample_concat(x.tensor(), skip.first().map(Input::tensor))
        }
        ("project", [depth, turn, shift]) => {
            let turn = turn.tensor::<2>();
            let [n, _] = turn.dims();
            let identity = Tensor::<2>::eye(3, &turn.device()).reshape([1, 3, 3]);
            let homography = turn.reshape([n, 3, 3]) + identity;
            ops::project(depth.tensor(), homography, shift.tensor())
        }
        ("smoothness", [disparity, image]) => {
            ops::smoothness(disparity.tensor(), image.tensor()).reshape([1, 1, 1, 1])
        }
        (operation, inputs) => panic!("{operation} of {} inputs", inputs.len()),
    }
}

/// The reference keeps every value whose index is a multiple of this.
fn step(len: usize) -> usize {
    if len <= AT_MOST {
        1
    } else {
        (len / AT_MOST) | 1
    }
}

#[test]
fn outputs_and_gradients_are_pytorchs() {
    let cases = std::fs::read_to_string(reference("operations.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_str(&cases).unwrap();
    let expected = weights::read(&reference("operations.safetensors")).unwrap();
    let device = Device::flex().autodiff();
    let (mut compared, mut largest) = (0, (0.0, String::new()));
    for case in &cases {
        let name = &case.name;
        let inputs: Vec<Input> = case
            .inputs
            .iter()
            .map(|(key, shape, scale, offset)| {
                let values = uniform(&format!("{name}/{key}"), shape.iter().product(), None);
                let values: Vec<f32> = values.iter().map(|v| offset + scale * v).collect();
                Input {
                    leaf: Tensor::<1>::from_data(values.as_slice(), &device).require_grad(),
                    shape: shape.clone(),
                }
            })
            .collect();
        let output = run(case, &inputs);
        let shape = output.dims();
        let pattern = uniform(&format!("{name}/pattern"), shape.iter().product(), None);
        let pattern = Tensor::<1>::from_data(pattern.as_slice(), &device).reshape(shape);
        let gradients = output.clone().mul(pattern).sum().backward();
        let mut check = |what: &str, actual: Vec<f32>| {
            let name = format!("{name}/{what}");
            let (difference, rms) =
                largest_difference(&expected, &name, &actual, step(actual.len()));
            let error = difference / rms;
            compared += 1;
            if error > largest.0 {
                largest = (error, name.clone());
            }
            assert!(error < TOLERANCE, "{name}: {error:e}");
        };
        check("output", output.into_data().try_into_vec().unwrap());
        for ((key, ..), input) in case.inputs.iter().zip(&inputs) {
            let gradient = input.leaf.grad(&gradients);
            let known = expected.tensors.contains_key(&format!("{name}/{key}"));
            assert_eq!(gradient.is_some(), known, "{name}/{key}");
            if let Some(gradient) = gradient {
                check(key, gradient.into_data().try_into_vec().unwrap());
            }
        }
    }
    println!("largest of {compared}: {:.1e} ({})", largest.0, largest.1);
    assert_eq!(compared, expected.tensors.len(), "every reference is used");
}
