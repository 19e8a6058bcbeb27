//! Lite-Mono's operations: depthwise convolutions, attention between channels, positional encoding, bilinear enlargement.

use proptest::prelude::*;

use super::build::{Builder, deviation, noise, noise_image};
use super::oracle::run;
use crate::dispatch::tests::{Level, with_level};
use crate::{Activation, Border, Depthwise, Engine, Graph, Op, Precision, ValueId};

/// Parameters of a small network.
#[derive(Debug, Clone)]
struct LiteSettings {
    heads: usize,
    /// Channels of a head.
    each: usize,
    expansion: usize,
    kernel: usize,
    rates: Vec<usize>,
}

fn depthwise(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    kernel: usize,
    [stride, dilation]: [usize; 2],
) -> ValueId {
    let channels = b.graph.shape(input).channels;
    let mut values = |n: usize| -> Vec<f32> { (0..n).map(|_| (b.noise)()).collect() };
    let op = Depthwise {
        input,
        weight: values(channels * kernel * kernel),
        bias: values(channels),
        kernel,
        stride,
        dilation,
    };
    b.push(Op::Depthwise(Box::new(op)))
}

/// The 1×1 convolutions of a block, with its input added.
fn bottleneck(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    residual: ValueId,
    expansion: usize,
) -> ValueId {
    let channels = b.graph.shape(input).channels;
    let inner = b.conv(input, expansion * channels, |c| {
        (c.kernel, c.activation) = (1, Activation::Gelu)
    });
    b.conv(inner, channels, |c| {
        (c.kernel, c.activation, c.residual) = (1, Activation::Identity, Some(residual))
    })
}

fn point(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    channels: usize,
    residual: Option<ValueId>,
) -> ValueId {
    b.conv(input, channels, |c| {
        (c.kernel, c.activation, c.residual) = (1, Activation::Identity, residual)
    })
}

/// A stage of the encoder.
fn stage(b: &mut Builder<impl FnMut() -> f32>, mut x: ValueId, p: &LiteSettings) -> ValueId {
    for rate in &p.rates {
        let seen = depthwise(b, x, p.kernel, [1, *rate]);
        x = bottleneck(b, seen, x, p.expansion);
    }
    let shape = b.graph.shape(x);
    let code = b.push(Op::Position {
        per_axis: 5,
        halvings: shape.halvings,
    });
    let placed = point(b, code, shape.channels, Some(x));
    let normed = b.push(Op::ChannelNorm {
        input: placed,
        epsilon: 1e-6,
    });
    let input = point(b, normed, 3 * shape.channels, None);
    let temperature = (0..p.heads).map(|_| 2.0 * (b.noise)()).collect();
    let mixed = b.push(Op::CrossCovariance { input, temperature });
    let mixed = point(b, mixed, shape.channels, Some(placed));
    let normed = b.push(Op::ChannelNorm {
        input: mixed,
        epsilon: 1e-3,
    });
    bottleneck(b, normed, x, p.expansion)
}

fn network(seed: u64, p: &LiteSettings) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.45; 3], [0.225; 3]),
        noise: noise(seed),
    };
    let width = p.heads * p.each;
    let gelu = |c: &mut crate::Conv| (c.stride, c.activation) = (2, Activation::Gelu);
    let stem = b.conv(ValueId::IMAGE, width, gelu);
    let small = depthwise(&mut b, ValueId::IMAGE, 3, [2, 1]);
    let inputs = vec![stem, small];
    let joined = b.push(Op::Concat { inputs });
    let start = b.conv(joined, width, |c| {
        (c.stride, c.activation) = (2, Activation::Identity)
    });
    let fine = stage(&mut b, start, p);
    let smaller = depthwise(&mut b, small, 3, [2, 1]);
    let inputs = vec![start, fine, smaller];
    let joined = b.push(Op::Concat { inputs });
    // Channels with gaps between them.
    let normed = b.push(Op::ChannelNorm {
        input: joined,
        epsilon: 1e-6,
    });
    let coarse = b.conv(normed, width, |c| c.stride = 2);
    let reflected =
        |c: &mut crate::Conv| (c.border, c.activation) = (Border::Reflect, Activation::Elu);
    let x = b.conv(coarse, 7, reflected);
    let large = b.push(Op::Enlarge { input: x });
    let inputs = vec![large, fine];
    let joined = b.push(Op::Concat { inputs });
    let x = b.conv(joined, 9, reflected);
    let x = b.push(Op::Enlarge { input: x });
    let x = b.conv(x, 1, |c| {
        reflected(c);
        c.activation = Activation::Identity;
    });
    let x = b.push(Op::Enlarge { input: x });
    let head = b.conv(x, 1, |c| {
        (c.kernel, c.activation) = (1, Activation::Sigmoid)
    });
    b.graph.add_output(head);
    b.graph.add_output(large);
    b.graph
}

/// Small parameters of all kinds.
pub(super) fn small_network() -> Graph {
    let settings = LiteSettings {
        heads: 2,
        each: 9,
        expansion: 2,
        kernel: 3,
        rates: vec![1, 4],
    };
    network(11, &settings)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn operations_equal_their_definitions(
        seed in any::<u64>(),
        (heads, each, expansion) in (1_usize..5, 1_usize..40, 1_usize..4),
        kernel in prop::sample::select(vec![1_usize, 3, 5]),
        // Some dilations exceed the image: those taps read only padding.
        rates in prop::collection::vec(1_usize..9, 0..3),
        (across, down) in (2_usize..7, 2_usize..7),
    ) {
        let settings = LiteSettings { heads, each, expansion, kernel, rates };
        let graph = network(seed, &settings);
        let (width, height) = (8 * across, 8 * down);
        let image = noise_image(seed ^ 1, width, height);
        let values = run(&graph, &image, height, width);
        let exact = [0, 1].map(|i: usize| &values[graph.outputs()[i].0]);
        for level in [Level::Widest, Level::Scalar, #[cfg(target_arch = "x86_64")] Level::Avx2] {
            let off = with_level(level, || {
                let mut engine =
                    Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
                // Twice, as one image must not affect the next.
                engine.run(&noise_image(seed ^ 7, width, height));
                engine.run(&image);
                [0, 1].map(|i: usize| deviation(&engine.output(i), exact[i]))
            });
            // f32 through some twenty layers; layer norms of few channels amplify rounding.
            prop_assert!(off[0] < 1e-4, "{level:?} off by {off:?}");
        }
        if Engine::has_bf16() {
            let mut engine = Engine::new(graph.clone(), width, height, Precision::Bf16).unwrap();
            engine.run(&image);
            let output = engine.output(0);
            prop_assert!(output.iter().all(|v| v.is_finite()));
            let square: f64 = output.iter().zip(&exact[0].data)
                .map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
            let usual = (square / output.len() as f64).sqrt();
            prop_assert!(usual < 0.1, "bf16 off by {usual} in the mean square");
        }
    }
}

#[test]
fn operations_that_do_not_fit_are_refused() {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(1),
    };
    let full = b.conv(ValueId::IMAGE, 12, |_| ());
    let mean = b.push(Op::GlobalMean { input: full });
    let refused = |op: Op, why: &str| {
        let error = b.graph.clone().push("op", op).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    let with = |change: fn(&mut Depthwise)| {
        let mut op = Depthwise {
            input: full,
            weight: vec![0.0; 12 * 9],
            bias: vec![0.0; 12],
            kernel: 3,
            stride: 1,
            dilation: 1,
        };
        change(&mut op);
        Op::Depthwise(Box::new(op))
    };
    refused(with(|op| op.weight.truncate(9)), "108 weights");
    refused(with(|op| op.bias.truncate(9)), "12 biases");
    refused(with(|op| op.stride = 3), "stride 3");
    refused(with(|op| op.dilation = 0), "dilation 0");
    refused(Op::Enlarge { input: full }, "larger than the image");
    let norm = |input, epsilon| Op::ChannelNorm { input, epsilon };
    refused(norm(full, 0.0), "epsilon");
    refused(norm(mean, 1e-6), "single pixel");
    let attention = |heads: usize| Op::CrossCovariance {
        input: full,
        temperature: vec![1.0; heads],
    };
    refused(
        attention(3),
        "12 channels of input, expected a multiple of 3 × 3 ",
    );
    refused(attention(0), "heads");
    let position = |per_axis, halvings| Op::Position { per_axis, halvings };
    refused(position(0, 1), "channels per axis");
    refused(position(4, 60), "halved");

    let joined = b.push(Op::Concat {
        inputs: vec![full, full, full],
    });
    let mixed = b.push(Op::CrossCovariance {
        input: joined,
        temperature: vec![1.0],
    });
    b.graph.add_output(mixed);
    let error = Engine::new(b.graph, 8, 8, Precision::F32).unwrap_err();
    assert!(error.to_string().contains("concatenation"), "{error}");
}
