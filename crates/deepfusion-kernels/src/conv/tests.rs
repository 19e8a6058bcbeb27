//! Compares the convolution with its definition, summed in f64, for random shapes.

use super::*;
use crate::noise::noise32 as noise;
use crate::scratch::with_scratch;
use proptest::prelude::*;

/// Every product of the convolution: (output index, input index, weight index).
fn products(s: &ConvShape, mut visit: impl FnMut(usize, usize, usize)) {
    let reflect = |i: isize, n: usize| -> Option<usize> {
        let n = n as isize;
        match i {
            _ if (0..n).contains(&i) => Some(i as usize),
            _ if !s.reflect => None,
            _ if i < 0 => Some((-i) as usize),
            _ => Some((2 * (n - 1) - i) as usize),
        }
    };
    for n in 0..s.batch {
        for o in 0..s.out_channels {
            for y in 0..s.out_height() {
                for x in 0..s.out_width() {
                    for c in 0..s.in_channels {
                        for ky in 0..s.kernel_height {
                            for kx in 0..s.kernel_width {
                                let at = |p: usize, k: usize| {
                                    (p * s.stride + k * s.dilation) as isize - s.padding as isize
                                };
                                let iy = reflect(at(y, ky), s.in_height);
                                let ix = reflect(at(x, kx), s.in_width);
                                if let (Some(iy), Some(ix)) = (iy, ix) {
                                    visit(
                                        ((n * s.out_channels + o) * s.out_height() + y)
                                            * s.out_width()
                                            + x,
                                        ((n * s.in_channels + c) * s.in_height + iy) * s.in_width
                                            + ix,
                                        ((o * s.in_channels + c) * s.kernel_height + ky)
                                            * s.kernel_width
                                            + kx,
                                    );
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// How precise a pass must be.
#[derive(Clone, Copy)]
pub(super) enum Form {
    /// Rounding grows with the number of summed products: about ε·√n·|term|, with some margin.
    Plain,
    /// Sums larger than the result are subtracted, so the error is some hundred ε of a typical value.
    Winograd,
}

pub(super) fn assert_close(ours: &[f32], exact: &[f64], form: Form, what: &str) {
    let typical = (exact.iter().map(|b| b * b).sum::<f64>() / exact.len().max(1) as f64).sqrt();
    for (i, (a, b)) in ours.iter().zip(exact).enumerate() {
        let most = match form {
            Form::Plain => 2e-5 * (1.0 + b.abs()),
            Form::Winograd => 5e-5 * (1.0 + b.abs()).max(typical),
        };
        assert!(
            (f64::from(*a) - b).abs() < most,
            "{what}[{i}]: {a} instead of {b}"
        );
    }
}

/// The expected results of the passes, from the definition.
pub(super) struct Exact {
    pub(super) output: Vec<f64>,
    pub(super) input_gradient: Vec<f64>,
    pub(super) weight_gradient: Vec<f64>,
    bias_gradient: Vec<f64>,
}

impl Exact {
    pub(super) fn of(s: &ConvShape) -> Self {
        let [x, w, b, g] = inputs(s);
        let channel = |i: usize| i / s.out_area() % s.out_channels;
        let output = (0..s.out_len()).map(|i| f64::from(b[channel(i)]));
        let mut exact = Self {
            output: output.collect(),
            input_gradient: vec![0.0; s.in_len()],
            weight_gradient: vec![0.0; s.weight_len()],
            bias_gradient: vec![0.0; s.out_channels],
        };
        products(s, |o, i, k| {
            let (xv, wv, gv) = (f64::from(x[i]), f64::from(w[k]), f64::from(g[o]));
            exact.output[o] += xv * wv;
            exact.input_gradient[i] += gv * wv;
            exact.weight_gradient[k] += gv * xv;
        });
        for (i, v) in g.iter().enumerate() {
            exact.bias_gradient[channel(i)] += f64::from(*v);
        }
        exact
    }
}

/// Image, weights, bias and the output's gradient. For bf16, all values are exact in bf16, so that only sums are rounded.
pub(super) fn inputs(s: &ConvShape) -> [Vec<f32>; 4] {
    let lengths = [s.in_len(), s.weight_len(), s.out_channels, s.out_len()];
    std::array::from_fn(|i| {
        let mut values = noise(lengths[i], i as u64 + 1);
        if s.precision == Precision::Bf16 {
            for value in &mut values {
                *value = f32::from_bits(value.to_bits() & 0xffff_0000);
            }
        }
        values
    })
}

/// The output, and the gradients of image, weights and bias.
fn all_passes(s: &ConvShape) -> [Vec<f32>; 4] {
    let [x, w, b, g] = inputs(s);
    // Filled with garbage: every value must be overwritten.
    let (mut y, mut gx) = (vec![7.0; s.out_len()], vec![7.0; s.in_len()]);
    let (mut gw, mut gb) = (vec![7.0; s.weight_len()], vec![7.0; s.out_channels]);
    conv2d(s, &x, &w, Some(&b), &mut y);
    conv2d_backward_input(s, &w, &g, &mut gx);
    conv2d_backward_weight(s, &x, &g, &mut gw);
    crate::channel_sums(&g, s.batch, s.out_area(), &mut gb);
    [y, gx, gw, gb]
}

fn check(s: &ConvShape) {
    let [x, w, b, g] = inputs(s);
    let exact = Exact::of(s);
    let form = |is_faster: bool| {
        if s.is_plain_3x3() && is_faster {
            Form::Winograd
        } else {
            Form::Plain
        }
    };
    let [y, gx, gw, gb] = all_passes(s);
    let is_faster = forward::winograd_sum(s, &x, &w, Some(&b)).is_faster();
    assert_close(&y, &exact.output, form(is_faster), "output");
    let is_faster = input_gradient::winograd_sum(s, &w, &g).is_faster();
    assert_close(
        &gx,
        &exact.input_gradient,
        form(is_faster),
        "input gradient",
    );
    let is_faster = weight_gradient::winograd(s, &x, &g).is_faster();
    assert_close(
        &gw,
        &exact.weight_gradient,
        form(is_faster),
        "weight gradient",
    );
    assert_close(&gb, &exact.bias_gradient, Form::Plain, "bias gradient");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    /// On a processor without bf16, this tests f32 again.
    #[test]
    fn pairs_equal_the_definition(
        batch in 1usize..6, in_channels in 1usize..5, out_channels in 1usize..4,
        in_height in 4usize..12, in_width in 4usize..17,
        kernel in prop::sample::select(vec![1usize, 3, 5]),
        stride in 1usize..4, padding in 0usize..4, dilation in 1usize..3, reflect in any::<bool>(),
    ) {
        let shape = ConvShape {
            batch, in_channels: 16 * in_channels, in_height, in_width, out_channels: 16 * out_channels,
            kernel_height: kernel, kernel_width: kernel, stride, padding, dilation, reflect,
            precision: Precision::Bf16,
        };
        let fits = shape.out_height() > 0 && shape.out_width() > 0;
        prop_assume!(fits && (!reflect || padding < in_height.min(in_width)));
        check(&shape);
    }

    #[test]
    fn equals_the_definition(
        batch in 1usize..6, in_channels in 1usize..20, out_channels in 1usize..12,
        in_height in 4usize..14, in_width in 4usize..17,
        kernel in prop::sample::select(vec![1usize, 2, 3, 5, 7]),
        stride in 1usize..4, padding in 0usize..4, dilation in 1usize..4, reflect in any::<bool>(),
    ) {
        let shape = ConvShape {
            batch, in_channels, in_height, in_width, out_channels,
            kernel_height: kernel, kernel_width: kernel, stride, padding, dilation, reflect,
            precision: Precision::F32,
        };
        prop_assume!(shape.out_height() > 0 && shape.out_width() > 0);
        check(&shape);
    }
}

/// Large enough for several tiles in an image, and for tiles of several images; with few outputs and many.
#[test]
fn equals_the_definition_across_tiles() {
    for out_channels in [4, 11] {
        let shape = ConvShape {
            batch: 2,
            in_channels: 16,
            in_height: 64,
            in_width: 96,
            out_channels,
            kernel_height: 3,
            kernel_width: 3,
            stride: 1,
            padding: 1,
            dilation: 1,
            reflect: true,
            precision: Precision::F32,
        };
        check(&shape);
        check(&ConvShape {
            batch: 9,
            in_channels: 40,
            in_height: 6,
            in_width: 9,
            reflect: false,
            ..shape
        });
        check(&ConvShape {
            batch: 3,
            in_channels: 3,
            kernel_height: 7,
            kernel_width: 7,
            stride: 2,
            padding: 3,
            reflect: false,
            ..shape
        });
    }
}

/// The same in bf16: rows of an image in several tiles, at both strides, and odd numbers of steps and blocks.
#[test]
fn pairs_equal_the_definition_across_tiles() {
    for (stride, reflect) in [(1, true), (1, false), (2, false), (2, true)] {
        check(&ConvShape {
            batch: 1,
            in_channels: 48,
            in_height: 64,
            in_width: 97,
            out_channels: 80,
            kernel_height: 3,
            kernel_width: 3,
            stride,
            padding: 1,
            dilation: 1,
            reflect,
            precision: Precision::Bf16,
        });
    }
}

/// Leaves buffers full of NaN for the next `nested` nested borrowers on this thread.
fn fill_scratch_with_garbage(nested: usize) {
    with_scratch(1 << 22, |buffer| {
        if nested > 1 {
            fill_scratch_with_garbage(nested - 1);
        }
        buffer.fill(f32::NAN);
    });
}

/// Sums are divided by the shape alone, never by the number of threads. So one thread and three give the same bits, whether tasks share
/// tiles, channels or weights, and whatever their buffers contained before.
#[test]
fn threads_do_not_change_a_bit() {
    let shape = ConvShape {
        batch: 3,
        in_channels: 24,
        in_height: 33,
        in_width: 70,
        out_channels: 17,
        kernel_height: 3,
        kernel_width: 3,
        stride: 1,
        padding: 1,
        dilation: 1,
        reflect: false,
        precision: Precision::F32,
    };
    // Above the limit from which the weight gradient is divided by channels.
    let many_weights = ConvShape {
        in_channels: 96,
        in_height: 6,
        in_width: 9,
        out_channels: 96,
        ..shape
    };
    let cases = [
        shape,
        many_weights,
        ConvShape {
            reflect: true,
            ..shape
        },
        // Winograd's form, with few weights and with many.
        ConvShape {
            in_channels: 32,
            out_channels: 48,
            ..shape
        },
        ConvShape {
            in_channels: 64,
            out_channels: 128,
            reflect: true,
            ..shape
        },
        ConvShape { stride: 2, ..shape },
        ConvShape {
            out_channels: 2,
            ..shape
        },
        ConvShape {
            in_channels: 48,
            out_channels: 80,
            precision: Precision::Bf16,
            ..shape
        },
        ConvShape {
            in_channels: 128,
            precision: Precision::Bf16,
            ..many_weights
        },
    ];
    for shape in cases {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                fill_scratch_with_garbage(4);
                all_passes(&shape)
            })
        };
        let alone = on(1);
        assert!(alone.iter().flatten().all(|v| v.is_finite()));
        assert!(alone == on(3), "{shape:?}");
    }
}
