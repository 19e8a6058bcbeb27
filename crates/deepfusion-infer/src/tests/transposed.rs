//! Transposed convolutions as convolutions followed by depth to space, and sizes that are not divisible by 2.

use proptest::prelude::*;

use super::build::{Builder, deviation, noise, noise_image};
use super::oracle::run;
use crate::dispatch::tests::{Level, with_level};
use crate::{Activation, Engine, Graph, Op, Precision, ValueId};

/// A small DispNet: halved four times, rounding up, and enlarged again with skips; each scale's disparity is read by the next.
fn network(seed: u64, widths: [usize; 4], kernel: usize) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.5; 3], [0.5; 3]),
        noise: noise(seed),
    };
    let (mut x, mut skips) = (ValueId::IMAGE, Vec::new());
    for width in widths {
        x = b.conv(x, width, |c| (c.kernel, c.stride) = (kernel, 2));
        x = b.conv(x, width, |_| ());
        skips.push(x);
    }
    skips.pop();
    let mut head = x;
    for (index, width) in widths.into_iter().rev().enumerate() {
        let wide = b.conv(x, 4 * width, |_| ());
        let large = b.push(Op::DepthToSpace { input: wide });
        let mut inputs = vec![large];
        inputs.extend(skips.pop());
        // Sizes are exact up to half of the image's size.
        if index == 3 {
            inputs.push(b.push(Op::Enlarge { input: head }));
        }
        let joined = b.push(Op::Concat { inputs });
        x = b.conv(joined, width, |_| ());
        head = b.conv(x, 1, |c| c.activation = Activation::Sigmoid);
    }
    b.graph.add_output(head);
    b.graph.add_output(x);
    b.graph
}

pub(super) fn small_network() -> Graph {
    network(6, [5, 16, 20, 7], 5)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn operations_equal_their_definitions(
        seed in any::<u64>(),
        widths in [1_usize..24, 1_usize..40, 1_usize..40, 1_usize..40],
        kernel in prop::sample::select(vec![3_usize, 5, 7]),
        (across, down) in (2_usize..30, 2_usize..30),
    ) {
        let graph = network(seed, widths, kernel);
        let (width, height) = (2 * across, 2 * down);
        let image = noise_image(seed ^ 1, width, height);
        let values = run(&graph, &image, height, width);
        let exact = &values[graph.outputs()[0].0];
        prop_assert_eq!((exact.height, exact.width), (height, width));
        for level in [Level::Widest, Level::Scalar, #[cfg(target_arch = "x86_64")] Level::Avx2] {
            let off = with_level(level, || {
                let mut engine = Engine::new(graph.clone(), width, height, Precision::F32).unwrap();
                // Twice, as one image must not affect the next.
                engine.run(&noise_image(seed ^ 7, width, height));
                engine.run(&image);
                deviation(&engine.output(0), exact)
            });
            // f32 through some twenty layers.
            prop_assert!(off < 3e-5, "{level:?} off by {off}");
        }
        if Engine::has_bf16() {
            let mut engine = Engine::new(graph.clone(), width, height, Precision::Bf16).unwrap();
            engine.run(&image);
            let off = deviation(&engine.output(0), exact);
            prop_assert!(off < 0.06, "bf16 off by {off}");
        }
    }
}

/// Enlargements that double the size exactly need exact halvings; the rest of the network does not.
#[test]
fn sizes_may_round_up_where_they_are_cropped() {
    let graph = small_network();
    assert!(graph.check_size(34, 22).is_ok());
    let error = graph.check_size(34, 21).unwrap_err().to_string();
    assert!(error.contains("multiples of 2"), "{error}");
}

#[test]
fn channels_that_do_not_divide_into_pixels_are_refused() {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(1),
    };
    let half = b.conv(ValueId::IMAGE, 6, |c| c.stride = 2);
    let refused = |input, why: &str| {
        let op = Op::DepthToSpace { input };
        let error = b.graph.clone().push("op", op).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    refused(half, "6 channels of input, expected a multiple of 4");
    refused(ValueId::IMAGE, "3 channels");
    let full = b.conv(ValueId::IMAGE, 8, |_| ());
    let error = b.graph.push("op", Op::DepthToSpace { input: full });
    let error = error.unwrap_err().to_string();
    assert!(error.contains("larger than the image"), "{error}");
}
