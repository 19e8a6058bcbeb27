//! Context, attention and aggregation: dilated convolutions, means, masks, concatenations of one size.

use proptest::prelude::*;

use super::build::{Builder, deviation, noise, noise_image};
use super::oracle::run;
use crate::dispatch::tests::{Level, with_level};
use crate::{Activation, Border, Conv, Engine, Graph, Op, Precision, ValueId};

/// Parameters of a small network's skip path.
#[derive(Debug, Clone)]
struct SkipPath {
    widths: [usize; 3],
    rates: Vec<usize>,
    global: bool,
    residual: bool,
    /// Dilation of the convolution at full depth, whose border is reflected if it is odd.
    dilation: usize,
}

/// A 1×1 convolution of an image's mean.
fn on_mean(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    channels: usize,
    activation: Activation,
) -> ValueId {
    let mean = b.push(Op::GlobalMean { input });
    point(b, mean, channels, activation)
}

fn point(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    channels: usize,
    activation: Activation,
) -> ValueId {
    b.conv(input, channels, |c| {
        (c.kernel, c.activation) = (1, activation)
    })
}

/// The paper's skip path.
fn skip(
    b: &mut Builder<impl FnMut() -> f32>,
    input: ValueId,
    width: usize,
    p: &SkipPath,
) -> ValueId {
    let mut branches = vec![point(b, input, width, Activation::Relu)];
    let reduced = point(b, input, width, Activation::Relu);
    for rate in &p.rates {
        branches.push(b.conv(reduced, width, |c| c.dilation = *rate));
    }
    let everywhere = p.global.then(|| {
        let global = on_mean(b, input, width, Activation::Relu);
        point(b, global, width, Activation::Identity)
    });
    let joined = b.push(Op::Concat { inputs: branches });
    let x = b.conv(joined, width, |c| (c.kernel, c.residual) = (1, everywhere));
    let hidden = on_mean(b, x, width.div_ceil(8), Activation::Relu);
    let channel = point(b, hidden, width, Activation::Sigmoid);
    let extent = b.push(Op::ChannelExtent { input: x });
    let spatial = b.conv(extent, 1, |c| {
        (c.kernel, c.activation) = (7, Activation::Sigmoid)
    });
    b.push(Op::Gate {
        input: x,
        spatial,
        channel,
        residual: p.residual,
    })
}

fn network(seed: u64, p: &SkipPath) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.485, 0.456, 0.406], [0.229, 0.224, 0.225]),
        noise: noise(seed),
    };
    let [w0, w1, w2] = p.widths;
    let f0 = b.conv(ValueId::IMAGE, w0, |c| (c.kernel, c.stride) = (7, 2));
    let f1 = b.push(Op::MaxPool { input: f0 });
    let border = [Border::Zero, Border::Reflect][p.dilation % 2];
    let f2 = b.conv(f1, w1, |c| (c.dilation, c.border) = (p.dilation, border));
    let (s1, s2) = (skip(&mut b, f1, w0, p), skip(&mut b, f2, w2, p));
    let pixel = on_mean(&mut b, s2, w2, Activation::Identity);
    let x = b.push(Op::AddPixel { input: s2, pixel });
    let reflected = |c: &mut Conv| (c.border, c.activation) = (Border::Reflect, Activation::Elu);
    let x = b.conv(x, w1, reflected);
    let x = b.push(Op::Concat {
        inputs: vec![x, s1],
    });
    let mut x = b.conv(x, w1, reflected);
    for skip in [Some(f0), None] {
        x = b.push(Op::UpsampleConcat { input: x, skip });
        x = b.conv(x, w0, reflected);
    }
    let head = b.conv(x, 1, |c| {
        reflected(c);
        c.activation = Activation::Sigmoid;
    });
    b.graph.add_output(head);
    b.graph.add_output(pixel);
    b.graph
}

/// Small parameters of all kinds.
pub(super) fn small_network() -> Graph {
    let parts = SkipPath {
        widths: [8, 16, 16],
        rates: vec![3],
        global: true,
        residual: true,
        dilation: 1,
    };
    network(9, &parts)
}

fn check(graph: &Graph, width: usize, height: usize, seed: u64) -> Result<(), TestCaseError> {
    let image = noise_image(seed, width, height);
    let values = run(graph, &image, height, width);
    let exact = &values[graph.outputs()[0].0];
    let pixel = &values[graph.outputs()[1].0];
    let f32_off = |level| {
        with_level(level, || {
            let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
            // Twice, as one image must not affect the next.
            engine.run(&noise_image(seed ^ 7, width, height));
            engine.run(&image);
            let off = deviation(&engine.output(0), exact);
            off.max(deviation(&engine.output(1), pixel))
        })
    };
    for level in [
        Level::Widest,
        Level::Scalar,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2,
    ] {
        let off = f32_off(level);
        // Tolerance as for the plain networks: f32 through some fifteen layers, including the Winograd form.
        prop_assert!(off < 3e-5, "{level:?} off by {off}");
    }
    if Engine::has_bf16() {
        let mut engine = Engine::new(graph.clone(), width, height, Precision::Bf16).unwrap();
        engine.run(&image);
        let off = deviation(&engine.output(0), exact);
        prop_assert!(off < 0.06, "bf16 off by {off}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn skip_paths_equal_the_definition(
        seed in any::<u64>(),
        widths in [1_usize..40, 1_usize..70, 1_usize..80],
        // Some dilations exceed the image: those taps read only padding.
        rates in prop::collection::vec(1_usize..14, 0..4),
        (global, residual) in any::<(bool, bool)>(),
        dilation in 1_usize..5,
        (across, down) in (6_usize..12, 6_usize..12),
    ) {
        let parts = SkipPath { widths, rates, global, residual, dilation };
        check(&network(seed, &parts), 4 * across, 4 * down, seed ^ 1)?;
    }
}

/// At least 1,024 pixels at a quarter of the size, so that dilated kernels use Winograd's form, phase by phase.
#[test]
fn large_dilated_convolutions_use_winograds_form_and_equal_the_definition() {
    let parts = SkipPath {
        widths: [16, 32, 48],
        rates: vec![2, 3, 6],
        global: true,
        residual: false,
        dilation: 2,
    };
    let graph = network(5, &parts);
    let (width, height) = (212, 120);
    let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
    let steps = engine.profile(&noise_image(1, width, height));
    let winograd = steps.iter().filter(|(name, _)| name.ends_with("winograd"));
    assert!(winograd.count() >= 7, "{steps:?}");
    check(&graph, width, height, 3).unwrap();
}

#[test]
fn nan_reaches_the_output_and_not_the_next_image() {
    let graph = small_network();
    let mut engine = Engine::new(graph.clone(), 64, 64, Precision::F32).unwrap();
    engine.run(&vec![f32::NAN; 3 * 64 * 64]);
    assert!(engine.output(0).iter().all(|v| v.is_nan()));
    let image = noise_image(4, 64, 64);
    let exact = run(&graph, &image, 64, 64);
    engine.run(&image);
    let off = deviation(&engine.output(0), &exact[graph.outputs()[0].0]);
    assert!(off < 3e-5, "off by {off}");
}

#[test]
fn operations_that_do_not_fit_are_refused() {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(1),
    };
    let full = b.conv(ValueId::IMAGE, 4, |_| ());
    let half = b.conv(full, 4, |c| c.stride = 2);
    let mean = b.push(Op::GlobalMean { input: full });
    let wide = b.conv(mean, 5, |c| c.kernel = 1);
    let mask = b.conv(full, 1, |_| ());
    let refused = |op: Op, why: &str| {
        let error = b.graph.clone().push("op", op).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    refused(Op::Concat { inputs: vec![] }, "nothing");
    let inputs = vec![full, half];
    refused(Op::Concat { inputs }, "appended");
    refused(Op::GlobalMean { input: mean }, "single pixel");
    refused(Op::MaxPool { input: mean }, "single pixel");
    let gate = |input, spatial, channel| Op::Gate {
        input,
        spatial,
        channel,
        residual: false,
    };
    refused(gate(full, full, mean), "spatial mask");
    refused(gate(half, mask, mean), "spatial mask");
    refused(gate(full, mask, wide), "every pixel");
    refused(gate(full, mask, full), "every pixel");
    let add = |pixel| Op::AddPixel { input: full, pixel };
    refused(add(half), "every pixel");
    refused(add(wide), "every pixel");

    // Operands of products and sums must have the layout of a convolution's output.
    let joined = b.push(Op::Concat {
        inputs: vec![full, full],
    });
    let pixel = b.push(Op::GlobalMean { input: joined });
    let sum = b.push(Op::AddPixel {
        input: joined,
        pixel,
    });
    b.graph.add_output(sum);
    let error = Engine::new(b.graph, 8, 8, Precision::F32).unwrap_err();
    assert!(error.to_string().contains("concatenation"), "{error}");
}
