//! Small random networks.

use deepfusion_geometry::DepthRange;
use deepfusion_infer::{Activation, Border, Conv, Depthwise, Graph, Op, ValueId};
use deepfusion_onnx::{DepthModel, FocalLength};

/// A sequence without a pattern, from a seed.
pub(crate) struct Random(pub u64);

impl Random {
    /// 0 to `below` − 1.
    pub(crate) fn below(&mut self, below: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % below
    }

    /// −1 to 1.
    pub(crate) fn signed(&mut self) -> f32 {
        self.below(20_001) as f32 / 10_000.0 - 1.0
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

/// A convolution with random weights, small enough that sums stay near 1.
pub(crate) fn conv(
    random: &mut Random,
    graph: &Graph,
    input: ValueId,
    channels_out: usize,
) -> Conv {
    let channels_in = graph.shape(input).channels;
    let kernel = random.pick(&[1, 3, 3, 5]);
    let taps = channels_in * kernel * kernel;
    let scale = 2.0 / (taps as f32).sqrt();
    let border = random.pick(&[Border::Zero, Border::Reflect]);
    // A reflected border is at most as wide as what it mirrors.
    let dilation = match border {
        Border::Zero => random.pick(&[1, 1, 2, 5]),
        Border::Reflect => 1,
    };
    Conv {
        input,
        weight: (0..channels_out * taps)
            .map(|_| scale * random.signed())
            .collect(),
        bias: (0..channels_out).map(|_| random.signed()).collect(),
        channels_in,
        channels_out,
        kernel,
        stride: 1,
        dilation,
        border,
        residual: None,
        activation: random.pick(&[
            Activation::Identity,
            Activation::Relu,
            Activation::Elu,
            Activation::Sigmoid,
            Activation::Gelu,
        ]),
    }
}

/// A 1×1 convolution of a single pixel.
fn point(random: &mut Random, graph: &Graph, input: ValueId, channels_out: usize) -> Op {
    let channels_in = graph.shape(input).channels;
    let mut weights = |n: usize| (0..n).map(|_| random.signed()).collect::<Vec<_>>();
    Op::Conv(Box::new(Conv {
        input,
        weight: weights(channels_in * channels_out),
        bias: weights(channels_out),
        channels_in,
        channels_out,
        kernel: 1,
        stride: 1,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: Activation::Sigmoid,
    }))
}

/// Masks from a value, a convolution with a pixel added everywhere, and the network's last operation: its gate.
fn attended(random: &mut Random, graph: &mut Graph, x: ValueId, name: &str) -> Op {
    let push =
        |part: &str, op: Op, graph: &mut Graph| graph.push(format!("{name}.{part}"), op).unwrap();
    let channels_out = graph.shape(x).channels;
    let mean = push("mean", Op::GlobalMean { input: x }, graph);
    let channel = point(random, graph, mean, channels_out);
    let channel = push("channel", channel, graph);
    let mut shifted = conv(random, graph, x, channels_out);
    shifted.residual = Some(channel);
    let input = push("shifted", Op::Conv(Box::new(shifted)), graph);
    let extent = push("extent", Op::ChannelExtent { input }, graph);
    let spatial = conv(random, graph, extent, 1);
    let spatial = push("spatial", Op::Conv(Box::new(spatial)), graph);
    Op::Gate {
        input,
        spatial,
        channel,
        residual: random.below(2) == 0,
    }
}

/// Each channel with its own kernel.
fn depthwise(random: &mut Random, graph: &Graph, input: ValueId) -> Op {
    let channels = graph.shape(input).channels;
    let kernel = random.pick(&[1, 3, 5]);
    let stride = if graph.shape(input).halvings < 2 {
        random.pick(&[1, 2])
    } else {
        1
    };
    let dilation = random.pick(&[1, 2, 4]);
    let mut weights = |n: usize| (0..n).map(|_| random.signed()).collect::<Vec<_>>();
    Op::Depthwise(Box::new(Depthwise {
        input,
        weight: weights(channels * kernel * kernel),
        bias: weights(channels),
        kernel,
        stride,
        dilation,
    }))
}

/// Normalised channels with the pixels' positions, and the network's last operation: attention between them.
fn mixed(random: &mut Random, graph: &mut Graph, x: ValueId, name: &str) -> Op {
    let mut push = |part: &str, op: Op| graph.push(format!("{name}.{part}"), op).unwrap();
    // With at least two channels: a single one always equals its mean.
    let normed = push(
        "norm",
        Op::ChannelNorm {
            input: x,
            epsilon: 0.3,
        },
    );
    let heads = 1 + random.below(3);
    let width = 3 * heads * (1 + random.below(4));
    let halvings = graph.shape(x).halvings;
    let mut push = |part: &str, op: Op| graph.push(format!("{name}.{part}"), op).unwrap();
    let per_axis = 1 + random.below(3);
    let code = push("code", Op::Position { per_axis, halvings });
    let placed = conv(random, graph, code, width);
    let placed = graph
        .push(format!("{name}.placed"), Op::Conv(Box::new(placed)))
        .unwrap();
    let mut all = conv(random, graph, normed, width);
    all.residual = Some(placed);
    let input = graph.push(format!("{name}.all"), Op::Conv(Box::new(all)));
    Op::CrossCovariance {
        input: input.unwrap(),
        temperature: (0..heads).map(|_| 3.0 * random.signed()).collect(),
    }
}

/// A step of a gated unit from a value, and the network's last operation: its new state.
fn gated(random: &mut Random, graph: &mut Graph, x: ValueId, name: &str) -> Op {
    let channels = graph.shape(x).channels;
    let mut layer = |part: &str, input: ValueId, activation: Activation, graph: &mut Graph| {
        let op = Conv {
            activation,
            ..conv(random, graph, input, channels)
        };
        graph
            .push(format!("{name}.{part}"), Op::Conv(Box::new(op)))
            .unwrap()
    };
    let share = layer("share", x, Activation::Sigmoid, graph);
    let reset = layer("reset", x, Activation::Tanh, graph);
    let kept = Op::Multiply { inputs: [reset, x] };
    let kept = graph.push(format!("{name}.kept"), kept).unwrap();
    let candidate = layer("candidate", kept, Activation::LeakyRelu, graph);
    Op::Blend {
        state: x,
        candidate,
        share,
    }
}

/// A value's first step to the image's size with learned weights, and the network's last operation.
fn enlarged_by_weights(
    random: &mut Random,
    graph: &mut Graph,
    x: ValueId,
    name: &str,
    halvings: u32,
) -> Op {
    let mut layer = |part: &str, channels: usize| {
        let op = conv(random, graph, x, channels);
        graph
            .push(format!("{name}.{part}"), Op::Conv(Box::new(op)))
            .unwrap()
    };
    let input = layer("small", 1);
    let weights = layer("weights", 9 << (2 * halvings));
    Op::ConvexUpsample {
        input,
        weights,
        halvings,
    }
}

/// A network of every operation, in an order and with connections given by the seed.
pub(crate) fn model(seed: u64) -> DepthModel {
    let mut random = Random(seed);
    let r = &mut random;
    let mean = [0; 3].map(|_| 0.5 + 0.2 * r.signed());
    let std = [0; 3].map(|_| 0.3 + 0.1 * r.signed());
    let mut graph = Graph::new(mean, std);
    let mut values = vec![ValueId::IMAGE];
    for i in 0..4 + r.below(8) {
        let input = r.pick(&values);
        let shape = graph.shape(input);
        let channels_out = 1 + r.below(5);
        let name = format!("stage.{i}");
        let op = match r.below(12) {
            0 if shape.halvings < 2 => Op::MaxPool { input },
            1 if shape.halvings > 0 => {
                let fitting = |v: &&ValueId| graph.shape(**v).halvings + 1 == shape.halvings;
                let skips: Vec<_> = values.iter().filter(fitting).copied().collect();
                let skip = (!skips.is_empty() && r.below(3) > 0).then(|| r.pick(&skips));
                Op::UpsampleConcat { input, skip }
            }
            4 => {
                let fitting = |v: &&ValueId| graph.shape(**v).halvings == shape.halvings;
                let others: Vec<_> = values.iter().filter(fitting).copied().collect();
                let inputs = vec![input, r.pick(&others), r.pick(&others)];
                Op::Concat { inputs }
            }
            5 => attended(r, &mut graph, input, &name),
            6 => depthwise(r, &graph, input),
            7 => mixed(r, &mut graph, input, &name),
            8 if shape.halvings > 0 => Op::Enlarge { input },
            9 => gated(r, &mut graph, input, &name),
            11 if shape.halvings > 0 => {
                let wide = conv(r, &graph, input, 4 * channels_out);
                let name = format!("{name}.wide");
                let input = graph.push(name, Op::Conv(Box::new(wide))).unwrap();
                Op::DepthToSpace { input }
            }
            10 if shape.halvings > 0 => {
                enlarged_by_weights(r, &mut graph, input, &name, shape.halvings)
            }
            _ => {
                let mut conv = conv(r, &graph, input, channels_out);
                if shape.halvings < 2 && r.below(3) == 0 {
                    conv.stride = 2;
                }
                let halvings = shape.halvings + u32::from(conv.stride == 2);
                let fitting = |v: &&ValueId| {
                    let other = graph.shape(**v);
                    (other.channels, other.halvings) == (channels_out, halvings)
                };
                conv.residual = values.iter().rev().find(fitting).copied();
                Op::Conv(Box::new(conv))
            }
        };
        values.push(graph.push(name, op).unwrap());
    }
    let last = values[values.len() - 1];
    let mean = graph.push("mean", Op::GlobalMean { input: last }).unwrap();
    let pixel = point(r, &graph, mean, graph.shape(last).channels);
    let pixel = graph.push("pixel", pixel).unwrap();
    let input = last;
    let mut last = graph.push("sum", Op::AddPixel { input, pixel }).unwrap();
    for i in 0..graph.shape(last).halvings {
        let op = Op::UpsampleConcat {
            input: last,
            skip: None,
        };
        last = graph.push(format!("up.{i}"), op).unwrap();
    }
    let mut head = conv(r, &graph, last, 1);
    head.activation = Activation::Sigmoid;
    let output = graph.push("head", Op::Conv(Box::new(head))).unwrap();
    graph.add_output(output);
    let (width, height) = (16 + 4 * r.below(4), 12 + 4 * r.below(3));
    let max_m = 50.0 + r.below(1000) as f64 / 7.0;
    let trained_with = (r.below(2) == 0).then(|| FocalLength {
        fx: 100.0 / 3.0,
        fy: r.below(1000) as f64 / 7.0,
    });
    DepthModel {
        graph,
        range: DepthRange { min_m: 0.1, max_m },
        width,
        height,
        canonical: trained_with.is_some() && r.below(2) == 0,
        trained_with,
    }
}
