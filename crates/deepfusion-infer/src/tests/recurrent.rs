//! R-MSFM's operations: gated recurrent units, refined values and convex upsampling.

use proptest::prelude::*;

use super::build::{Builder, deviation, noise, noise_image};
use super::oracle::run;
use crate::dispatch::tests::{Level, with_level};
use crate::{Activation, Border, Conv, Engine, Graph, Op, Precision, ValueId};

/// Two steps of a gated unit that refine a single channel, which is then enlarged.
fn network(seed: u64, channels: usize, halvings: u32) -> Graph {
    let mut b = Builder {
        graph: Graph::new([0.45; 3], [0.225; 3]),
        noise: noise(seed),
    };
    let mut x = ValueId::IMAGE;
    for _ in 0..halvings {
        x = b.conv(x, channels, |c| {
            (c.stride, c.border, c.activation) = (2, Border::Reflect, Activation::LeakyRelu);
        });
    }
    let mut state = b.conv(x, channels, |c| c.activation = Activation::Tanh);
    let mut refined = b.conv(state, 1, |c| {
        (c.kernel, c.activation) = (1, Activation::Identity)
    });
    for _ in 0..2 {
        let read = b.conv(x, channels, |c| c.activation = Activation::Tanh);
        let joined = b.push(Op::Concat {
            inputs: vec![state, read],
        });
        let gate = |c: &mut Conv| c.activation = Activation::Sigmoid;
        let (share, reset) = (
            b.conv(joined, channels, gate),
            b.conv(joined, channels, gate),
        );
        let kept = b.push(Op::Multiply {
            inputs: [reset, state],
        });
        let joined = b.push(Op::Concat {
            inputs: vec![kept, read],
        });
        let candidate = b.conv(joined, channels, |c| c.activation = Activation::Tanh);
        state = b.push(Op::Blend {
            state,
            candidate,
            share,
        });
        // Joined below: a padded vector of channels, and a single channel without padding.
        let seen = b.conv(refined, 5, |c| {
            (c.kernel, c.border, c.activation) = (7, Border::Reflect, Activation::LeakyRelu);
        });
        let joined = b.push(Op::Concat {
            inputs: vec![state, seen, refined],
        });
        let before = refined;
        refined = b.conv(joined, 1, |c| {
            (c.residual, c.activation) = (Some(before), Activation::Identity);
        });
    }
    let value = b.conv(refined, 1, |c| {
        (c.kernel, c.activation) = (1, Activation::Sigmoid)
    });
    let weights = b.conv(state, 9 << (2 * halvings), |c| {
        (c.kernel, c.activation) = (1, Activation::Identity);
    });
    let large = b.push(Op::ConvexUpsample {
        input: value,
        weights,
        halvings,
    });
    b.graph.add_output(large);
    b.graph
}

/// Small parameters of all kinds.
pub(super) fn small_network() -> Graph {
    network(5, 19, 2)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn operations_equal_their_definitions(
        seed in any::<u64>(),
        channels in 1_usize..40,
        halvings in 1_u32..4,
        (across, down) in (4_usize..8, 4_usize..8),
    ) {
        let graph = network(seed, channels, halvings);
        let (width, height) = (8 * across, 8 * down);
        let image = noise_image(seed ^ 1, width, height);
        let values = run(&graph, &image, height, width);
        let exact = &values[graph.outputs()[0].0];
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

#[test]
fn values_that_do_not_fit_are_refused() {
    let mut b = Builder {
        graph: Graph::new([0.4; 3], [0.3; 3]),
        noise: noise(1),
    };
    let full = b.conv(ValueId::IMAGE, 12, |_| ());
    let half = b.conv(full, 12, |c| c.stride = 2);
    let one = b.conv(half, 1, |_| ());
    let weights = b.conv(half, 36, |_| ());
    let refused = |op: Op, why: &str| {
        let error = b.graph.clone().push("op", op).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    refused(
        Op::Multiply {
            inputs: [full, half],
        },
        "combined with",
    );
    refused(
        Op::Blend {
            state: half,
            candidate: half,
            share: one,
        },
        "combined with",
    );
    let convex = |input, weights, halvings| Op::ConvexUpsample {
        input,
        weights,
        halvings,
    };
    refused(convex(half, weights, 1), "upsampling of 12 channels");
    refused(convex(one, half, 1), "weights of");
    refused(convex(one, weights, 0), "expected 1 to 3");
    refused(convex(one, weights, 9), "expected 1 to 3");
    let quarter = b.conv(ValueId::IMAGE, 1, |_| ());
    let for_it = b.conv(full, 36, |_| ());
    refused_beyond(&b.graph, convex(quarter, for_it, 1));
}

/// Checks that an operation is rejected because its output would be larger than the image.
fn refused_beyond(graph: &Graph, op: Op) {
    let error = graph.clone().push("op", op).unwrap_err().to_string();
    assert!(error.contains("larger than the image"), "{error}");
}
