//! Compares Winograd's form with the definition, whether or not it is faster, and its transforms on all instruction sets.

use super::backward_transform::{TransformGradients, TransformTaps};
use super::transform::{TransformInputs, TransformKernels, TransformOutputs};
use crate::conv::product::LANES;
use crate::conv::tests::{Exact, Form, assert_close, inputs};
use crate::conv::{ConvShape, Precision, forward, input_gradient, weight_gradient};
use crate::noise::noise32 as noise;
use crate::slot::room;
use crate::winograd::{AREA, OUT};
use proptest::prelude::*;
use pulp::Simd;

/// Every pass in this form for this shape, with both ways of dividing weights.
fn check(s: &ConvShape) {
    let [x, w, b, g] = inputs(s);
    let exact = Exact::of(s);
    if s.in_channels.is_multiple_of(LANES) {
        for bias in [None, Some(&*b)] {
            let mut y = vec![7.0; s.out_len()];
            let sum = forward::winograd_sum(s, &x, &w, bias);
            forward::by_winograd(s, &sum, room(&mut y));
            if bias.is_none() {
                let of_channel = |i: usize| b[i / s.out_area() % s.out_channels];
                y.iter_mut()
                    .enumerate()
                    .for_each(|(i, y)| *y += of_channel(i));
            }
            assert_close(&y, &exact.output, Form::Winograd, "output");
        }
    }
    if s.out_channels.is_multiple_of(LANES) {
        let mut gx = vec![7.0; s.in_len()];
        let sum = input_gradient::winograd_sum(s, &w, &g);
        input_gradient::by_winograd(s, &sum, room(&mut gx));
        assert_close(&gx, &exact.input_gradient, Form::Winograd, "input gradient");
    }
    for many in [false, true] {
        let mut gw = vec![7.0; s.weight_len()];
        let gradient = weight_gradient::winograd(s, &x, &g);
        weight_gradient::by_winograd(s, &gradient, many, &mut gw);
        assert_close(
            &gw,
            &exact.weight_gradient,
            Form::Winograd,
            "weight gradient",
        );
    }
}

fn shape(
    batch: usize,
    (in_channels, out_channels): (usize, usize),
    (in_height, in_width): (usize, usize),
    reflect: bool,
) -> ConvShape {
    ConvShape {
        batch,
        in_channels,
        in_height,
        in_width,
        out_channels,
        kernel_height: 3,
        kernel_width: 3,
        stride: 1,
        padding: 1,
        dilation: 1,
        reflect,
        precision: Precision::F32,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn every_pass_equals_the_definition(
        batch in 1usize..4, others in 1usize..20, swapped in any::<bool>(), sixteens in 1usize..3,
        in_height in 1usize..14, in_width in 1usize..14, reflect in any::<bool>(),
    ) {
        prop_assume!(!reflect || in_height.min(in_width) > 1);
        let channels = (16 * sixteens, others);
        let channels = if swapped { (channels.1, channels.0) } else { channels };
        check(&shape(batch, channels, (in_height, in_width), reflect));
    }
}

/// Several parts in a task, several images in a part, rows longer than a part, and groups of output channels.
#[test]
fn parts_of_every_kind_equal_the_definition() {
    for reflect in [false, true] {
        for (batch, channels, size) in [
            (1, (160, 16), (40, 68)),
            (19, (48, 64), (8, 7)),
            (1, (16, 32), (8, 800)),
            (3, (96, 80), (10, 9)),
        ] {
            check(&shape(batch, channels, size, reflect));
        }
    }
}

/// Root mean square of error over value: the loss of precision in a layer of 64 channels.
#[test]
fn rounding_stays_small() {
    let s = shape(1, (64, 64), (24, 80), false);
    let [x, w, _, g] = inputs(&s);
    let exact = Exact::of(&s);
    let relative = |ours: &[f32], exact: &[f64]| {
        let square = |sum: f64, value: f64| sum + value * value;
        let error = ours.iter().zip(exact).map(|(a, b)| f64::from(*a) - b);
        (error.fold(0.0, square) / exact.iter().copied().fold(0.0, square)).sqrt()
    };
    let (mut gx, mut gw) = (vec![7.0; s.in_len()], vec![7.0; s.weight_len()]);
    let sum = input_gradient::winograd_sum(&s, &w, &g);
    input_gradient::by_winograd(&s, &sum, room(&mut gx));
    let gradient = weight_gradient::winograd(&s, &x, &g);
    weight_gradient::by_winograd(&s, &gradient, true, &mut gw);
    let errors = [
        relative(&gx, &exact.input_gradient),
        relative(&gw, &exact.weight_gradient),
    ];
    println!("{errors:?}");
    assert!(errors.iter().all(|error| *error < 4e-6), "{errors:?}");
}

/// All transforms, one after the other.
fn transforms<S: Simd>(simd: S) -> Vec<f32> {
    const TILES: usize = 3 * LANES;
    let mut inputs = vec![0.0; AREA * (TILES + 5)];
    simd.vectorize(TransformInputs {
        from: &noise(AREA * (TILES + 3), 1),
        pitch: TILES + 3,
        tiles: TILES,
        to: &mut inputs,
        to_pitch: TILES + 5,
    });
    let mut outputs = vec![0.0; OUT * OUT * TILES];
    simd.vectorize(TransformOutputs {
        from: &noise(AREA * (TILES + 7), 2),
        pitch: TILES + 7,
        tiles: TILES,
        bias: 0.3,
        to: &mut outputs,
        to_pitch: TILES,
    });
    let taps = noise(9 * LANES, 3);
    let (taps, _) = taps.as_chunks::<LANES>();
    let mut kernels = [[0.0; LANES]; AREA];
    if let Some(taps) = taps.first_chunk() {
        simd.vectorize(TransformKernels {
            taps,
            to: &mut kernels,
        });
    }
    let mut gradients = vec![0.0; AREA * 5 * LANES];
    simd.vectorize(TransformGradients {
        from: &noise(OUT * OUT * 5 * LANES, 4),
        pitch: OUT * 5 * LANES,
        tiles: 5,
        channels: LANES,
        to: &mut gradients,
        to_pitch: 5 * LANES,
    });
    let mut sums = vec![0.0; 9 * 2 * LANES];
    simd.vectorize(TransformTaps {
        from: &noise(AREA * 2 * LANES, 5),
        pitch: 2 * LANES,
        outputs: 2 * LANES,
        to: &mut sums,
    });
    [inputs, outputs, kernels.concat(), gradients, sums].concat()
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let scalar = transforms(pulp::Scalar::new());
    assert!(scalar.iter().all(|value| value.is_finite()));
    assert!(scalar.iter().filter(|value| **value == 0.0).count() < scalar.len() / 8);
    #[cfg(target_arch = "x86_64")]
    {
        let v3 = pulp::x86::V3::try_new().map(transforms);
        assert!(v3.is_none_or(|v3| v3 == scalar), "AVX2");
        let v4 = pulp::x86::V4::try_new().map(transforms);
        assert!(v4.is_none_or(|v4| v4 == scalar), "AVX-512");
    }
}
