//! A written file is read back unchanged, and no other file is read.

use std::collections::HashSet;

use crate::support::model;
use deepfusion_infer::{Activation, Border, Conv, Graph, Op, ValueId};
use deepfusion_onnx::check::{deviation, pictures, relative};
use deepfusion_onnx::{DepthMaps, DepthModel, Error, ModelProblem, OPSET, read, reference, write};
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_model_survives_its_file(seed: u64) {
        let model = model(seed);
        let again = read(&write(&model).unwrap()).unwrap();
        prop_assert_eq!(again, model);
    }

    #[test]
    fn damaged_files_are_refused_or_mean_the_same(seed: u64, at: prop::sample::Index, bit in 0..8) {
        let model = model(seed);
        let mut bytes = write(&model).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= 1_u8 << bit;
        if let Ok(again) = read(&bytes) {
            // A bit of a weight, of the range, or of a description: still a model of the same layers. One that
            // the output does not need may be lost: a bit of its field's number makes it one that readers skip.
            prop_assert_eq!(needed(&again.graph), needed(&model.graph));
            prop_assert!(again.validate().is_ok());
        }
        prop_assert!(read(&bytes[..at]).is_err());
    }
}

/// The names of the layers that the output depends on.
fn needed(graph: &Graph) -> Vec<&str> {
    let mut needed: HashSet<ValueId> = graph.outputs().iter().copied().collect();
    let mut names = Vec::new();
    for (i, node) in graph.nodes().iter().enumerate().rev() {
        if needed.contains(&ValueId(i + 1)) {
            needed.extend(node.op.inputs());
            names.push(node.name.as_str());
        }
    }
    names
}

#[test]
fn files_of_another_format_are_refused() {
    assert!(matches!(read(b"no onnx"), Err(Error::Decode(_))));
    assert!(matches!(read(b""), Err(Error::Model { part: "graph", .. })));
}

/// A network of one convolution.
fn single(change: impl FnOnce(&mut Conv)) -> DepthModel {
    let mut graph = Graph::new([0.45; 3], [0.225; 3]);
    let mut conv = Conv {
        input: ValueId::IMAGE,
        weight: (0..27).map(|i| i as f32 / 100.0).collect(),
        bias: vec![-1.0],
        channels_in: 3,
        channels_out: 1,
        kernel: 3,
        stride: 1,
        dilation: 1,
        border: Border::Reflect,
        residual: None,
        activation: Activation::Sigmoid,
    };
    change(&mut conv);
    let output = graph.push("only", Op::Conv(Box::new(conv))).unwrap();
    graph.add_output(output);
    DepthModel {
        graph,
        width: 6,
        height: 4,
        ..model(0)
    }
}

/// Replaces a word of the file by one of equal length.
fn with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at = bytes
        .windows(from.len())
        .position(|w| w == from.as_bytes())
        .unwrap();
    let mut changed = bytes.to_vec();
    changed[at..at + to.len()].copy_from_slice(to.as_bytes());
    changed
}

#[test]
fn other_networks_are_refused_by_the_node() {
    let bytes = write(&single(|_| ())).unwrap();
    let node = |from: &str, to: &str| match read(&with(&bytes, from, to)) {
        Err(Error::Node { name, op, .. }) => format!("{name} {op}"),
        other => panic!("{from} → {to}: {other:?}"),
    };
    // Each of these is a valid file with another meaning.
    assert_eq!(
        node("only.exp\"\u{3}Exp", "only.exp\"\u{3}Log"),
        "only.exp Log"
    );
    assert_eq!(node("reflect", "constan"), "only.pad Pad");
    assert_eq!(node("perm", "prem"), "image.planes Transpose");
    assert_eq!(node("Reciprocal", "Reciprocol"), "only.sigmoid Reciprocol");
    assert_eq!(node("Conv", "Comv"), "only.pad Pad");
    let range = read(&with(&bytes, "depth_min_m", "depth_mim_m"));
    let Err(Error::Model { part, reason }) = range else {
        panic!("{range:?}");
    };
    assert_eq!(part, "metadata");
    assert_eq!(reason, ModelProblem::MissingKey { key: "depth_min_m" });
    assert_eq!(reason.to_string(), "`depth_min_m` is missing");
}

#[test]
fn another_version_is_refused_by_both() {
    let mut bytes = write(&single(|_| ())).unwrap();
    // The layout's version is the file's first field.
    assert_eq!(bytes[..2], [8, 8]);
    bytes[1] = 9;
    let error = read(&bytes).unwrap_err();
    let operators = format!("[OperatorSet {{ domain: \"\", version: {OPSET} }}]");
    let text = format!(
        "ONNX model, version: file layout 9 with operators {operators}, expected 8 with {operators}"
    );
    assert_eq!(error.to_string(), text);
    let Error::Model {
        reason: ModelProblem::Version { found, expected },
        ..
    } = error
    else {
        panic!("{error:?}");
    };
    assert_eq!((found.layout, expected.layout), (9, 8));
    assert_eq!(found.operators, expected.operators);
}

/// An image with odd sides, halved with rounding up, and enlarged again by turning channels into pixels.
#[test]
fn channels_become_pixels_and_are_cut() {
    let mut graph = Graph::new([0.5; 3], [0.5; 3]);
    let mut layer = |name: &str, input: ValueId, channels: [usize; 2], stride: usize| {
        let [channels_in, channels_out] = channels;
        let count = channels_out * channels_in * 9;
        let conv = Conv {
            input,
            weight: (0..count)
                .map(|i| ((i * i) % 23) as f32 / 50.0 - 0.2)
                .collect(),
            bias: (0..channels_out).map(|i| i as f32 / 10.0).collect(),
            channels_in,
            channels_out,
            kernel: 3,
            stride,
            dilation: 1,
            border: Border::Zero,
            residual: None,
            activation: Activation::Identity,
        };
        let input = graph.push(name, Op::Conv(Box::new(conv))).unwrap();
        let pixels = format!("{name}.pixels");
        match stride {
            2 => input,
            _ => graph.push(pixels, Op::DepthToSpace { input }).unwrap(),
        }
    };
    let small = layer("small", ValueId::IMAGE, [3, 2], 2);
    let output = layer("large", small, [2, 4], 1);
    graph.add_output(output);
    let model = DepthModel {
        graph,
        width: 7,
        height: 5,
        ..model(0)
    };
    let bytes = write(&model).unwrap();
    assert_eq!(read(&bytes).unwrap(), model);
    let has = |text: &str| bytes.windows(text.len()).any(|w| w == text.as_bytes());
    assert!(has("large.pixels.whole") && has("Slice"));
    let rgb: Vec<u8> = (0..105_u32).map(|i| (i * 7 % 256) as u8).collect();
    let mut alone = model.graph.clone();
    alone.add_output(ValueId(2));
    let outputs = reference::run(&alone, &rgb, 7, 5).unwrap();
    let [pixels, channels] = &outputs[..] else {
        panic!("two outputs")
    };
    assert_eq!((pixels.len(), channels.len()), (35, 4 * 12));
    for y in 0..5 {
        for x in 0..7 {
            let channel = 2 * (y % 2) + x % 2;
            let expected = channels[channel * 12 + y / 2 * 4 + x / 2];
            assert_eq!(pixels[7 * y + x], expected, "{x} {y}");
        }
    }
    // If nothing has to be cropped, nothing is.
    let even = DepthModel {
        width: 8,
        height: 6,
        ..model
    };
    let bytes = write(&even).unwrap();
    assert_eq!(read(&bytes).unwrap(), even);
    assert!(!bytes.windows(5).any(|w| w == b"Slice"));
}

#[test]
fn models_that_cannot_be_written_are_refused() {
    let part = |model: &DepthModel| match write(model) {
        Err(Error::Model { part, .. }) => part.to_owned(),
        Err(Error::Node { name, .. }) => name,
        Err(Error::Network(error)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let mut model = single(|_| ());
    model.range.min_m = f64::NAN;
    assert_eq!(part(&model), "depth range");
    let model = single(|conv| (conv.stride, conv.border) = (2, Border::Zero));
    assert_eq!(part(&model), "outputs", "half the image's size");
    // Seven rows mirrored at the edge of an image of six.
    let wide = |conv: &mut Conv| (conv.kernel, conv.weight) = (13, vec![0.0; 3 * 13 * 13]);
    assert!(part(&single(wide)).contains("at least 7"));
    let mut model = single(|_| ());
    model.width = 1;
    assert!(part(&model).contains("1x4"));
    // Two nodes of one name, and a name that the file itself needs.
    for name in ["only", "depth", "image", ""] {
        let mut model = single(|_| ());
        let input = ValueId(1);
        let op = Op::Conv(Box::new(Conv {
            input,
            weight: vec![1.0],
            bias: vec![0.0],
            channels_in: 1,
            channels_out: 1,
            kernel: 1,
            stride: 1,
            dilation: 1,
            border: Border::Zero,
            residual: None,
            activation: Activation::Identity,
        }));
        model.graph.push(name, op).unwrap();
        assert_eq!(part(&model), name);
    }
}

#[test]
fn the_reference_computes_what_the_formula_says() {
    // Weights 1 on the centre of red alone: y = σ((red/255 − 0.45) / 0.225 − 1).
    let centre = |conv: &mut Conv| {
        conv.weight = vec![0.0; 27];
        conv.weight[4] = 1.0;
    };
    let model = single(centre);
    let rgb: Vec<u8> = (0..72).map(|i| (i * 3) as u8).collect();
    let maps = reference::depth(&model, &rgb).unwrap();
    for (i, pixel) in rgb.chunks(3).enumerate() {
        let x = (f64::from(pixel[0]) / 255.0 - 0.45) / 0.225 - 1.0;
        let depth = model.range.depth_m(1.0 / (1.0 + (-x).exp()));
        assert!((f64::from(maps.depth[i]) / depth - 1.0).abs() < 1e-5, "{i}");
        assert!(
            (maps.depth[i] * maps.disparity[i] - 1.0).abs() < 1e-6,
            "{i}"
        );
    }
    // The first row and column mirror the second, not themselves.
    let above = |conv: &mut Conv| {
        conv.weight = vec![0.0; 27];
        conv.weight[0] = 1.0;
    };
    let shifted = reference::depth(&single(above), &rgb).unwrap();
    assert_eq!(shifted.depth[0], maps.depth[7]);
    assert_eq!(shifted.depth[7], maps.depth[0]);
    assert!(matches!(
        reference::depth(&model, &rgb[1..]),
        Err(Error::Length {
            expected: 72,
            found: 71,
            ..
        })
    ));
}

#[test]
fn pooling_and_enlarging() {
    let mut graph = Graph::new([0.0; 3], [1.0; 3]);
    let pooled = graph
        .push(
            "pool",
            Op::MaxPool {
                input: ValueId::IMAGE,
            },
        )
        .unwrap();
    let large = graph
        .push(
            "up",
            Op::UpsampleConcat {
                input: pooled,
                skip: Some(ValueId::IMAGE),
            },
        )
        .unwrap();
    graph.add_output(pooled);
    graph.add_output(large);
    // One channel that matters: 0, 51, 102 … row by row; the others are constant.
    let rgb: Vec<u8> = (0..16).flat_map(|i| [i * 17, 255, 0]).collect();
    let outputs = reference::run(&graph, &rgb, 4, 4).unwrap();
    let unit = |values: &[u8]| {
        values
            .iter()
            .map(|v| f32::from(*v * 17) / 255.0)
            .collect::<Vec<_>>()
    };
    assert_eq!(outputs[0][..4], unit(&[5, 7, 13, 15]));
    assert_eq!(outputs[0][4..], [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(outputs[1].len(), 6 * 16);
    assert_eq!(outputs[1][..8], unit(&[5, 5, 7, 7, 5, 5, 7, 7]));
    assert_eq!(outputs[1][48..52], unit(&[0, 1, 2, 3]));
}

/// Every operation on the path of an attention, on numbers that can be followed by hand.
#[test]
fn means_masks_and_concatenations() {
    let mut graph = Graph::new([0.0; 3], [1.0; 3]);
    let mut push = |name: &str, op: Op| graph.push(name, op).unwrap();
    let input = ValueId::IMAGE;
    let mean = push("mean", Op::GlobalMean { input });
    let extent = push("extent", Op::ChannelExtent { input });
    // Twice the pixel to the right of the mean over the channels, three apart.
    let mut weight = vec![0.0; 2 * 9];
    weight[5] = 2.0;
    let spatial = Conv {
        input: extent,
        weight,
        bias: vec![0.0],
        channels_in: 2,
        channels_out: 1,
        kernel: 3,
        stride: 1,
        dilation: 3,
        border: Border::Zero,
        residual: None,
        activation: Activation::Identity,
    };
    let spatial = push("spatial", Op::Conv(Box::new(spatial)));
    let gate = |residual| Op::Gate {
        input,
        spatial,
        channel: mean,
        residual,
    };
    let (product, passed) = (push("product", gate(false)), push("passed", gate(true)));
    let sum = push("sum", Op::AddPixel { input, pixel: mean });
    let inputs = vec![sum, extent];
    let joined = push("joined", Op::Concat { inputs });
    for output in [mean, extent, spatial, product, passed, joined] {
        graph.add_output(output);
    }
    // Red 0, 51 … 765/15 a column, green 102, blue 0.
    let rgb: Vec<u8> = (0..8).flat_map(|i| [i % 4 * 51, 102, 0]).collect();
    let outputs = reference::run(&graph, &rgb, 4, 2).unwrap();
    let close = |values: &[f32], expected: &[f32]| {
        assert_eq!(values.len(), expected.len());
        for (v, e) in values.iter().zip(expected) {
            assert!((v - e).abs() < 1e-6, "{values:?} for {expected:?}");
        }
    };
    close(&outputs[0], &[0.3, 0.4, 0.0]);
    let means = [0.4, 0.6, 0.8, 1.0].map(|v| v / 3.0);
    close(&outputs[1][..4], &means);
    close(&outputs[1][8..12], &[0.4, 0.4, 0.4, 0.6]);
    close(&outputs[2][..4], &[2.0 / 3.0, 0.0, 0.0, 0.0]);
    // Green's first pixel: 0.4 · (2/3 · 0.4), plus its own value.
    close(&outputs[3][8..10], &[0.4 * 0.4 * 2.0 / 3.0, 0.0]);
    close(&outputs[4][8..10], &[0.4 + 0.4 * 0.4 * 2.0 / 3.0, 0.4]);
    close(&outputs[5][8..10], &[0.8, 0.8]);
    close(&outputs[5][24..28], &means);
}

#[test]
fn deviations_are_relative_to_the_largest_value() {
    assert_eq!(relative(&[1.0, 2.0], &[1.0, 4.0]), 0.5);
    assert_eq!(relative(&[0.0], &[0.0]), 0.0);
    assert_eq!(relative(&[1.0], &[0.0]), f64::INFINITY);
    assert_eq!(relative(&[f32::NAN], &[0.0]), f64::INFINITY);
    assert_eq!(relative(&[1.0], &[1.0, 1.0]), f64::INFINITY);
    let maps = |depth| DepthMaps {
        depth: vec![depth],
        disparity: vec![1.0],
    };
    let d = deviation(&[maps(1.0), maps(9.0)], &[maps(1.0), maps(10.0)]);
    assert!((d.worst() - 0.1).abs() < 1e-12 && d.disparity == 0.0 && !d.is_small());
}

#[test]
fn the_pictures_differ_and_fill_the_size() {
    let all = pictures(40, 24);
    for (i, picture) in all.iter().enumerate() {
        assert_eq!(picture.len(), 40 * 24 * 3);
        assert!(all[..i].iter().all(|other| other != picture));
    }
}
