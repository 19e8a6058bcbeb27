//! Compares int8 with integer arithmetic written out, and with the network in f64.

use super::build::{Builder, deviation, noise, noise_image};
use super::network;
use super::oracle::run;
use crate::element::{Bf16, Element};
use crate::{
    Activation, Border, Conv, Engine, Error, Graph, InputRanges, Op, Precision, SeenInputs, ValueId,
};

const SIZE: (usize, usize) = (26, 14);

/// A first convolution, which stays in bf16, and a second one that reads its result.
fn pair(second: impl Fn(&mut Conv)) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(5),
    };
    // The output has an odd size.
    let first = b.conv(ValueId::IMAGE, 32, |c| {
        (c.activation, c.stride) = (Activation::Elu, 2);
    });
    let second = b.conv(first, 72, second);
    b.graph.add_output(first);
    b.graph.add_output(second);
    b.graph
}

/// The ranges determined from an image.
fn observed(graph: &Graph, images: &[Vec<f32>], (width, height): (usize, usize)) -> InputRanges {
    let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
    let mut seen = SeenInputs::default();
    for image in images {
        engine.observe(image, &mut seen);
    }
    assert_eq!(seen.images(), images.len());
    let mut ranges = seen.ranges();
    ranges.retain(|name, _| graph.computed_in_int8().any(|n| n == name));
    ranges
}

/// The second convolution of [`pair`], computed from the stored output of the first: bytes, products, sums.
fn by_integers(graph: &Graph, input: &[f32], [low, high]: [f32; 2]) -> Vec<f32> {
    let Op::Conv(conv) = &graph.nodes()[1].op else {
        panic!("a convolution");
    };
    let (low, high) = (low.min(0.0), high.max(0.0));
    let step = (high - low) / 255.0;
    let zero = (-low / step).round();
    // In the engine's order: close to a tie, another order would round the other way.
    let byte = |x: f32| x.mul_add(step.recip(), zero).round_ties_even();
    let byte = |x: f32| byte(x).clamp(0.0, 255.0) as i64;
    let (width, height) = (SIZE.0 / 2, SIZE.1 / 2);
    let (w, h) = (width as isize, height as isize);
    let inputs = conv.channels_in * conv.kernel * conv.kernel;
    let half = conv.reach() as isize;
    let mirrored = |i: isize, n: isize| if i < 0 { -i } else { i.min(2 * (n - 1) - i) };
    let mut out = Vec::new();
    for o in 0..conv.channels_out {
        let own = &conv.weight[o * inputs..][..inputs];
        let most = own.iter().fold(0.0_f32, |most, w| most.max(w.abs()));
        let weights: Vec<i64> = own
            .iter()
            .map(|w| (w / (most / 127.0)).round() as i64)
            .collect();
        for y in 0..(h as usize).div_ceil(conv.stride) as isize {
            for x in 0..(w as usize).div_ceil(conv.stride) as isize {
                let mut sum = 0;
                for (i, weight) in weights.iter().enumerate() {
                    let (c, tap) = (
                        i / (conv.kernel * conv.kernel),
                        i % (conv.kernel * conv.kernel),
                    );
                    let at = |i: isize, k: usize| {
                        i * conv.stride as isize + (k * conv.dilation) as isize - half
                    };
                    let (mut v, mut u) = (at(y, tap / conv.kernel), at(x, tap % conv.kernel));
                    if conv.border == Border::Reflect {
                        (v, u) = (mirrored(v, h), mirrored(u, w));
                    }
                    let inside = (0..h).contains(&v) && (0..w).contains(&u);
                    let value = if inside {
                        input[(c * height + v as usize) * width + u as usize]
                    } else {
                        0.0
                    };
                    sum += weight * (byte(value) - zero as i64);
                }
                let value = f64::from(step * (most / 127.0)) * sum as f64;
                out.push((value + f64::from(conv.bias[o])) as f32);
            }
        }
    }
    out
}

#[test]
fn sums_equal_integer_arithmetic() {
    if !Engine::has_int8() {
        return;
    }
    let plain = |c: &mut Conv| c.activation = Activation::Identity;
    let changes: [&dyn Fn(&mut Conv); 5] = [
        &|_| (),
        &|c| c.border = Border::Reflect,
        &|c| c.stride = 2,
        &|c| (c.kernel, c.stride) = (1, 2),
        &|c| c.dilation = 3,
    ];
    let image = noise_image(9, SIZE.0, SIZE.1);
    for (i, change) in changes.into_iter().enumerate() {
        let mut graph = pair(|c| {
            plain(c);
            change(c);
        });
        let ranges = observed(&graph, std::slice::from_ref(&image), SIZE);
        graph.set_input_ranges(&ranges).unwrap();
        let mut engine = Engine::new(graph.clone(), SIZE.0, SIZE.1, Precision::Int8).unwrap();
        engine.run(&image);
        let expected = by_integers(&graph, &engine.output(0), ranges["node1"]);
        let found = engine.output(1);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            // Rounded to bf16 at the end. If the sum is close to a tie, f32 may round the other way.
            let rounded = Bf16::of(*expected).value();
            let step = expected.abs() / 128.0 + 1e-6;
            assert!(
                (found - rounded).abs() <= step,
                "{i}: {found} for {expected}"
            );
        }
        let same = found
            .iter()
            .zip(&expected)
            .filter(|(a, b)| **a == Bf16::of(**b).value())
            .count();
        assert!(
            same * 1000 >= 995 * found.len(),
            "{i}: {same} of {}",
            found.len()
        );
    }
}

#[test]
fn a_network_in_int8_is_near_its_definition_and_uses_int8() {
    if !Engine::has_int8() {
        return;
    }
    for (seed, widths) in [(7, [16, 64, 96, 32]), (8, [24, 40, 130, 20])] {
        let (width, height) = (96, 64);
        let mut graph = network(seed, widths, true, 7);
        let image = noise_image(3, width, height);
        let exact = run(&graph, &image, height, width);
        let exact = exact[graph.outputs()[0].0].clone();
        let ranges = observed(&graph, std::slice::from_ref(&image), (width, height));
        graph.set_input_ranges(&ranges).unwrap();
        let mut engine = Engine::new(graph, width, height, Precision::Int8).unwrap();
        let steps = engine.profile(&image);
        let in_int8 = steps
            .iter()
            .filter(|(name, _)| name.ends_with("int8"))
            .count();
        assert!(in_int8 >= 9, "{in_int8} of {steps:?}");
        let off = deviation(&engine.output(0), &exact);
        // A sigmoid's output after a dozen layers, each rounded to 255 steps.
        assert!(off < 0.1, "off by {off}");
        // One image must not affect the next, and another engine gives the same result.
        let first = engine.output(0);
        engine.run(&noise_image(4, width, height));
        engine.run(&image);
        assert_eq!(engine.output(0), first);
        let mut other = engine.another().unwrap();
        other.run(&image);
        assert_eq!(other.output(0), first);
    }
}

#[test]
fn int8_without_ranges_or_with_those_of_another_network_is_refused() {
    if !Engine::has_int8() {
        return;
    }
    let mut graph = pair(|_| ());
    let (width, height) = SIZE;
    let error = Engine::new(graph.clone(), width, height, Precision::Int8).unwrap_err();
    assert!(matches!(error, Error::Ranges { .. }), "{error}");
    for name in ["node0", "node7"] {
        let ranges = [(name.to_owned(), [0.0, 1.0])].into();
        let error = graph.set_input_ranges(&ranges).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
    for range in [
        [f32::NAN, 1.0],
        [0.0, f32::INFINITY],
        [2.0, 1.0],
        [f32::MIN, f32::MAX],
    ] {
        let ranges = [("node1".to_owned(), range)].into();
        assert!(graph.set_input_ranges(&ranges).is_err(), "{range:?}");
    }
    let ranges = [("node1".to_owned(), [-1.0, 4.0])].into();
    graph.set_input_ranges(&ranges).unwrap();
    Engine::new(graph, width, height, Precision::Int8).unwrap();
}
