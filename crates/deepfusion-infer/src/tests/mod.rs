//! Compares the engine with the operations' definitions in f64, on small random networks.

mod attention;
mod build;
#[cfg(target_arch = "x86_64")]
mod int8;
mod lite;
mod oracle;
mod plain;
mod recurrent;
mod remains;
mod transposed;

use proptest::prelude::*;

use crate::conv::ConvForm;
#[cfg(target_arch = "x86_64")]
use crate::conv::{Geometry, Runs};
use crate::dispatch::tests::{Level, with_level};
use crate::element::Element;
use crate::engine::Typed;
#[cfg(target_arch = "x86_64")]
use crate::forms::Bf16Conv;
#[cfg(target_arch = "x86_64")]
use crate::view::Shared;
use crate::{Activation, Border, Conv, Engine, Graph, Op, Precision, ValueId};
use build::{Builder, deviation, noise, noise_image};
use oracle::run;

/// A small version of the depth network: stem, pooling, blocks with and without a shortcut convolution, a decoder with skips, a head.
fn network(seed: u64, widths: [usize; 4], bottleneck: bool, stem: usize) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.485, 0.456, 0.406], [0.229, 0.224, 0.225]),
        noise: noise(seed),
    };
    let f0 = b.conv(ValueId::IMAGE, widths[0], |c| {
        (c.kernel, c.stride) = (stem, 2)
    });
    let pooled = b.graph.push("pool", Op::MaxPool { input: f0 }).unwrap();
    let x = b.conv(pooled, widths[1], |c| c.kernel = 1);
    let x = b.conv(x, widths[0], |c| c.residual = Some(pooled));
    let shortcut = b.conv(x, widths[2], |c| {
        (c.kernel, c.stride, c.activation) = (1, 2, Activation::Identity);
    });
    let y = b.conv(x, widths[2], |c| {
        (c.kernel, c.stride) = (if bottleneck { 1 } else { 3 }, 2);
    });
    let deep = b.conv(y, widths[2], |c| c.residual = Some(shortcut));
    let reflected = |c: &mut Conv| (c.border, c.activation) = (Border::Reflect, Activation::Elu);
    let mut up = deep;
    for (width, skip) in [
        (widths[3], Some(x)),
        (widths[1], Some(f0)),
        (widths[0], None),
    ] {
        up = b.conv(up, width, reflected);
        up = b
            .graph
            .push("up", Op::UpsampleConcat { input: up, skip })
            .unwrap();
        up = b.conv(up, width, reflected);
    }
    let head = b.conv(up, 1, |c| {
        reflected(c);
        c.activation = Activation::Sigmoid;
    });
    b.graph.add_output(head);
    b.graph
}

/// The first output of an engine in which all convolutions use one form.
fn output_of<E: Element, C: ConvForm<E>>(graph: Graph, image: &[f32], width: usize) -> Vec<f32> {
    let mut engine = Typed::<E, C>::new(graph, width, image.len() / 3 / width).unwrap();
    engine.run(image, |_, _| {});
    engine.output(0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_engine_equals_the_definition(
        seed in any::<u64>(),
        widths in [1_usize..40, 1_usize..70, 1_usize..150, 1_usize..40],
        bottleneck in any::<bool>(),
        stem in prop::sample::select(vec![3_usize, 7]),
        (across, down) in (2_usize..9, 2_usize..9),
    ) {
        let (width, height) = (8 * across, 8 * down);
        let graph = network(seed, widths, bottleneck, stem);
        let image = noise_image(seed ^ 1, width, height);
        let values = run(&graph, &image, height, width);
        let exact = &values[graph.outputs()[0].0];
        let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
        // Twice, as one image must not affect the next.
        for _ in 0..2 {
            engine.run(&image);
            let off = deviation(&engine.output(0), exact);
            // A sigmoid's output; f32 through 13 layers, including 1e-5 of the Winograd form.
            prop_assert!(off < 3e-5, "off by {off}");
        }
        for level in [Level::Scalar, #[cfg(target_arch = "x86_64")] Level::Avx2] {
            let narrow = with_level(level, || {
                let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
                engine.run(&image);
                engine.output(0)
            });
            let off = deviation(&narrow, exact);
            prop_assert!(off < 3e-5, "{level:?} off by {off}");
        }
        #[cfg(target_arch = "x86_64")]
        {
            use crate::element::Bf16;
            // Each of 13 layers rounds to 8 bits.
            if crate::bf16::has_amx() {
                let off = deviation(&output_of::<Bf16, crate::bf16::Amx>(graph.clone(), &image, width), exact);
                prop_assert!(off < 0.06, "amx off by {off}");
            }
            if crate::bf16::has_dot() {
                let off = deviation(&output_of::<Bf16, crate::bf16::Dot>(graph.clone(), &image, width), exact);
                prop_assert!(off < 0.06, "dot off by {off}");
                let off = deviation(&output_of::<Bf16, WithoutMatrixUnit>(graph, &image, width), exact);
                prop_assert!(off < 0.06, "without matrix unit off by {off}");
            }
        }
    }
}

#[test]
fn large_images_use_winograds_form_and_equal_the_definition() {
    let graph = network(7, [16, 64, 96, 32], true, 7);
    let (width, height) = (208, 72);
    let image = noise_image(3, width, height);
    let values = run(&graph, &image, height, width);
    let exact = &values[graph.outputs()[0].0];
    let mut engine = Engine::new(graph, width, height, Precision::F32).unwrap();
    let forms: Vec<String> = engine
        .profile(&image)
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    for form in ["winograd", "direct", "head"] {
        assert!(forms.iter().any(|f| f.ends_with(form)), "{forms:?}");
    }
    let off = deviation(&engine.output(0), exact);
    assert!(off < 3e-5, "off by {off}");
    #[cfg(target_arch = "x86_64")]
    {
        with_level(Level::Avx2, || engine.run(&image));
        let off = deviation(&engine.output(0), exact);
        assert!(off < 3e-5, "AVX2 off by {off}");
    }
}

/// The matrix unit and the dot products sum the same products in a different order.
#[cfg(target_arch = "x86_64")]
#[test]
fn both_bf16_forms_round_alike() {
    use crate::element::Bf16;
    if !crate::bf16::has_amx() {
        return;
    }
    let graph = network(11, [64, 128, 96, 32], true, 7);
    let (width, height) = (128, 72);
    let image = noise_image(5, width, height);
    let amx = output_of::<Bf16, crate::bf16::Amx>(graph.clone(), &image, width);
    let dot = output_of::<Bf16, crate::bf16::Dot>(graph, &image, width);
    let off = amx.iter().zip(&dot).map(|(a, b)| (a - b).abs());
    let (sum, most) = off.fold((0.0, 0.0_f32), |(sum, most), d| (sum + d, most.max(d)));
    let mean = sum / amx.len() as f32;
    assert!(mean < 1e-3 && most < 2e-2, "mean {mean}, most {most}");
}

/// What a processor without a matrix unit uses in bf16, tested on others, too.
#[cfg(target_arch = "x86_64")]
#[derive(Debug)]
struct WithoutMatrixUnit(Bf16Conv);

#[cfg(target_arch = "x86_64")]
impl ConvForm<crate::element::Bf16> for WithoutMatrixUnit {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        Self(Bf16Conv::without_matrix_unit(conv, geometry, channel_of))
    }

    fn overread(pitch: usize) -> usize {
        Bf16Conv::overread(pitch)
    }

    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn geometry(&self) -> &Geometry {
        self.0.geometry()
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        self.0.reads_beyond_inputs()
    }

    unsafe fn run(&self, arena: Shared<crate::element::Bf16>) {
        // SAFETY: guaranteed by the caller.
        unsafe { self.0.run(arena) };
    }
}

/// Every kind of convolution that uses Winograd's form in bf16: dilated or not, both kinds of border, a residual, padded channels, images
/// whose tiles extend over the edge.
#[cfg(target_arch = "x86_64")]
#[test]
fn winograd_in_bf16_is_as_near_the_truth_as_plain_sums() {
    use crate::element::Bf16;
    if !crate::bf16::has_dot() {
        return;
    }
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(21),
    };
    let first = b.conv(ValueId::IMAGE, 40, |c| c.border = Border::Reflect);
    let dilated = b.conv(first, 70, |c| c.dilation = 3);
    let deep = b.conv(dilated, 330, |c| {
        (c.border, c.activation) = (Border::Reflect, Activation::Elu);
    });
    let back = b.conv(deep, 70, |c| c.residual = Some(dilated));
    let head = b.conv(back, 1, |c| c.activation = Activation::Sigmoid);
    b.graph.add_output(head);
    let (width, height) = (49, 35);
    let image = noise_image(9, width, height);
    let values = run(&b.graph, &image, height, width);
    let exact = &values[b.graph.outputs()[0].0];
    let mut engine = Typed::<Bf16, WithoutMatrixUnit>::new(b.graph.clone(), width, height).unwrap();
    let mut forms = Vec::new();
    // The previous image may leave anything in the arena, which must not affect the next one.
    engine.poison();
    engine.run(&image, |_, form| forms.push(form.to_owned()));
    assert_eq!(forms.iter().filter(|form| *form == "winograd").count(), 3);
    let mean = |values: &[f32]| {
        let off = values.iter().zip(&exact.data);
        off.map(|(a, b)| (f64::from(*a) - b).abs()).sum::<f64>() / values.len() as f64
    };
    let dot = output_of::<Bf16, crate::bf16::Dot>(b.graph, &image, width);
    let (winograd, dot) = (mean(&engine.output(0)), mean(&dot));
    // Its inputs are rounded once more than those of plain sums.
    assert!(
        winograd < 2.5 * dot,
        "off by {winograd}, plain sums by {dot}"
    );
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let (width, height) = (128, 72);
    let image = noise_image(5, width, height);
    for precision in [Precision::F32, Precision::Bf16] {
        if precision == Precision::Bf16 && !Engine::has_bf16() {
            continue;
        }
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let graph = network(11, [64, 128, 96, 32], true, 7);
                let mut engine = Engine::new(graph, width, height, precision).unwrap();
                engine.run(&image);
                engine.output(0)
            })
        });
        assert_eq!(one, three, "{precision:?}");
    }
}

/// Combinations that no depth network has: the image convolved at full size and appended, a value appended twice, a concatenation enlarged
/// and pooled, wide reflection, several outputs.
fn odd_network() -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(77),
    };
    let wide = |c: &mut Conv| (c.kernel, c.border) = (5, Border::Reflect);
    let full = b.conv(ValueId::IMAGE, 24, wide);
    let small = b
        .graph
        .push(
            "pool",
            Op::MaxPool {
                input: ValueId::IMAGE,
            },
        )
        .unwrap();
    let half = b.conv(small, 8, |c| c.activation = Activation::Elu);
    let quarter = b.conv(half, 8, |c| c.stride = 2);
    let concat = |b: &mut Builder<_>, input, skip| {
        let op = Op::UpsampleConcat { input, skip };
        b.graph.push("concat", op).unwrap()
    };
    let once = concat(&mut b, quarter, Some(half));
    let again = concat(&mut b, quarter, Some(half));
    let pooled = b.graph.push("pool", Op::MaxPool { input: once }).unwrap();
    let third = b.conv(pooled, 8, |c| c.residual = Some(quarter));
    let enlarged = concat(&mut b, again, Some(ValueId::IMAGE));
    let nested = concat(&mut b, third, Some(once));
    let end = b.conv(enlarged, 20, |c| c.residual = None);
    let end = b.conv(end, 24, |c| c.residual = Some(full));
    let head = b.conv(end, 1, |c| c.activation = Activation::Sigmoid);
    for output in [head, end, nested, enlarged] {
        b.graph.add_output(output);
    }
    b.graph
}

#[test]
fn graphs_of_any_shape_are_laid_out_right_and_images_do_not_mix() {
    let graph = odd_network();
    let (width, height) = (64, 40);
    let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
    for seed in [1, 2, 3] {
        let mut image = noise_image(seed, width, height);
        if seed == 2 {
            // An invalid image must not affect the next one.
            image.fill(f32::NAN);
            engine.run(&image);
            assert!(engine.output(0).iter().all(|v| v.is_nan()));
            continue;
        }
        let values = run(&graph, &image, height, width);
        engine.run(&image);
        for (i, value) in graph.outputs().iter().enumerate() {
            let output = engine.output(i);
            assert_eq!(output.len(), values[value.0].data.len());
            let off = deviation(&output, &values[value.0]);
            assert!(off < 1e-4, "output {i} of image {seed} off by {off}");
        }
        if Engine::has_bf16() {
            let mut engine = Engine::new(graph.clone(), width, height, Precision::Bf16).unwrap();
            engine.run(&image);
            let off = deviation(&engine.output(0), &values[graph.outputs()[0].0]);
            assert!(off < 0.06, "bf16 off by {off}");
        }
    }
}

#[test]
fn graphs_that_cannot_be_laid_out_are_refused() {
    let mut graph = Graph::new([0.4; 3], [0.3; 3]);
    let conv = Conv {
        input: ValueId::IMAGE,
        weight: vec![0.1; 3 * 3 * 49],
        bias: vec![0.0; 3],
        channels_in: 3,
        channels_out: 3,
        kernel: 7,
        stride: 1,
        dilation: 1,
        border: Border::Reflect,
        residual: Some(ValueId::IMAGE),
        activation: Activation::Identity,
    };
    let mut added = graph.clone();
    let end = added.push("c", Op::Conv(Box::new(conv.clone()))).unwrap();
    added.add_output(end);
    let error = Engine::new(added, 8, 8, Precision::F32).unwrap_err();
    assert!(error.to_string().contains("residual"), "{error}");
    let plain = Conv {
        residual: None,
        ..conv.clone()
    };
    graph.push("c", Op::Conv(Box::new(plain))).unwrap();
    assert!(
        graph.check_size(3, 8).is_err(),
        "a kernel of seven pixels needs four to mirror"
    );
    assert!(graph.check_size(4, 8).is_ok());
    let huge = Conv {
        channels_in: 3,
        kernel: usize::MAX,
        ..conv
    };
    assert!(graph.push("c", Op::Conv(Box::new(huge))).is_err());
}

#[test]
fn images_too_large_for_memory_are_refused() {
    for side in [1 << 29, 1 << 33, 1 << 62] {
        let graph = network(7, [8, 8, 8, 8], true, 7);
        let error = Engine::new(graph, side, side, Precision::F32).unwrap_err();
        let (width, height) = (side, side);
        assert_eq!(error, crate::Error::Memory { width, height });
    }
}

#[test]
fn sizes_that_do_not_halve_are_refused() {
    let graph = network(7, [8, 8, 8, 8], true, 7);
    let error = Engine::new(graph, 100, 64, Precision::F32).unwrap_err();
    assert!(error.to_string().contains("100x64"), "{error}");
    assert!(error.to_string().contains("multiples of 8"), "{error}");
}
