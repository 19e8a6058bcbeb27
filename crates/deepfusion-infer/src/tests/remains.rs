//! No image affects the next one, whatever it contains.

use super::build::{Builder, deviation, noise, noise_image};
use super::oracle::run;
use super::plain::Plain;
use super::{attention, lite, network, odd_network, recurrent, transposed};
use crate::conv::ConvForm;
use crate::element::{Bf16, Element};
use crate::engine::Typed;
use crate::forms::F32Conv;
use crate::{Activation, Engine, Graph, Op, Precision, ValueId};

/// A number of inputs that no run length divides, and a concatenation of a value and its own convolution; the second output is a sum
/// without an activation.
fn dense_network(width: usize) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(21),
    };
    let start = b.conv(ValueId::IMAGE, width, |c| c.stride = 2);
    let next = b.conv(start, width, |_| ());
    let inputs = vec![start, next];
    let joined = b.push(Op::Concat { inputs });
    let wide = b.conv(joined, 48, |c| c.kernel = 1);
    let small = b.conv(wide, 40, |c| c.stride = 2);
    let large = b.push(Op::UpsampleConcat {
        input: small,
        skip: Some(start),
    });
    let end = b.conv(large, 16, |c| c.activation = Activation::Identity);
    let head = b.conv(end, 1, |c| c.activation = Activation::Sigmoid);
    b.graph.add_output(head);
    b.graph.add_output(end);
    b.graph
}

/// Many inputs at the start, and at the end a value large enough to be stored over and beyond them.
fn widening_network() -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(22),
    };
    let many = b.conv(ValueId::IMAGE, 1024, |c| c.stride = 2);
    let few = b.conv(many, 16, |c| c.kernel = 1);
    let large = b.push(Op::UpsampleConcat {
        input: few,
        skip: None,
    });
    let end = b.conv(large, 320, |c| c.activation = Activation::Identity);
    let head = b.conv(end, 1, |c| c.activation = Activation::Sigmoid);
    b.graph.add_output(head);
    b.graph.add_output(end);
    b.graph
}

fn graphs() -> Vec<(Graph, usize, usize)> {
    if cfg!(miri) {
        // Miri is some thousand times slower.
        return vec![
            (dense_network(20), 8, 8),
            (network(3, [4, 6, 5, 4], true, 3), 16, 16),
        ];
    }
    vec![
        (network(3, [24, 40, 72, 20], true, 7), 32, 24),
        (attention::small_network(), 32, 32),
        (odd_network(), 24, 16),
        (lite::small_network(), 32, 32),
        (recurrent::small_network(), 32, 32),
        (transposed::small_network(), 24, 20),
        (dense_network(48), 20, 12),
        (widening_network(), 12, 8),
    ]
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// The first output's bits, from an arena of zeros and from one full of NaN.
fn fresh_and_nan_filled<E: Element, C: ConvForm<E>>(
    graph: &Graph,
    (width, height): (usize, usize),
) -> [Vec<f32>; 2] {
    let image = noise_image(8, width, height);
    [false, true].map(|nan_filled| {
        let mut engine = Typed::<E, C>::new(graph.clone(), width, height).unwrap();
        if nan_filled {
            engine.poison();
        }
        engine.run(&image, |_, _| {});
        engine.output(0)
    })
}

fn nothing_stale_is_read<E: Element, C: ConvForm<E>>() {
    for (i, (graph, width, height)) in graphs().into_iter().enumerate() {
        let [fresh, nan_filled] = fresh_and_nan_filled::<E, C>(&graph, (width, height));
        assert!(fresh.iter().all(|v| v.is_finite()), "network {i}");
        assert!(bits(&fresh) == bits(&nan_filled), "network {i}");
    }
}

#[test]
fn nothing_stale_is_read_in_f32() {
    nothing_stale_is_read::<f32, F32Conv>();
}

#[test]
fn nothing_stale_is_read_in_bf16() {
    nothing_stale_is_read::<Bf16, Plain<2>>();
    nothing_stale_is_read::<Bf16, Plain<32>>();
    #[cfg(target_arch = "x86_64")]
    {
        if crate::bf16::has_dot() {
            nothing_stale_is_read::<Bf16, crate::bf16::Dot>();
            nothing_stale_is_read::<Bf16, super::WithoutMatrixUnit>();
        }
        if crate::bf16::has_amx() {
            nothing_stale_is_read::<Bf16, crate::bf16::Amx>();
        }
    }
}

/// The bf16 forms in plain code give the network's values, up to rounding.
#[test]
fn bf16_in_plain_code_equals_the_definition() {
    for (i, (graph, width, height)) in graphs().into_iter().enumerate() {
        let size = (width, height);
        let values = run(&graph, &noise_image(8, width, height), height, width);
        let exact = &values[graph.outputs()[0].0];
        let [dot, _] = fresh_and_nan_filled::<Bf16, Plain<2>>(&graph, size);
        let [amx, _] = fresh_and_nan_filled::<Bf16, Plain<32>>(&graph, size);
        for off in [deviation(&dot, exact), deviation(&amx, exact)] {
            assert!(off < 0.06, "network {i} off by {off}");
        }
    }
}

#[test]
fn an_image_that_overflows_does_not_affect_the_next() {
    let (graph, width, height) = (widening_network(), 12, 8);
    let image = noise_image(8, width, height);
    for precision in [Precision::F32, Precision::Bf16] {
        if precision == Precision::Bf16 && !Engine::has_bf16() {
            continue;
        }
        let engine = || Engine::new(graph.clone(), width, height, precision).unwrap();
        let mut fresh = engine();
        fresh.run(&image);
        let mut used = engine();
        let large: Vec<f32> = image.iter().map(|v| v * 1e38).collect();
        assert!(large.iter().all(|v| v.is_finite()));
        used.run(&large);
        assert!(used.output(1).iter().any(|v| !v.is_finite()), "overflows");
        used.run(&image);
        for output in [0, 1] {
            let (fresh, used) = (fresh.output(output), used.output(output));
            assert!(fresh.iter().all(|v| v.is_finite()));
            let same = bits(&fresh) == bits(&used);
            assert!(same, "{precision:?}, output {output}");
        }
    }
}

/// Engines that share a plan do not affect each other, even if they run at the same time.
#[test]
fn another_engine_gives_the_same_bits() {
    for precision in [Precision::F32, Precision::Bf16] {
        for (graph, width, height) in graphs() {
            let Ok(mut first) = Engine::new(graph, width, height, precision) else {
                assert!(precision == Precision::Bf16 && !Engine::has_bf16());
                continue;
            };
            let (image, other) = (noise_image(8, width, height), noise_image(9, width, height));
            first.run(&image);
            let expected = bits(&first.output(0));
            let mut second = first.another().unwrap();
            std::thread::scope(|scope| {
                scope.spawn(|| first.run(&other));
                second.run(&image);
            });
            assert!(bits(&second.output(0)) == expected);
            assert!(bits(&first.output(0)) != expected);
        }
    }
}
