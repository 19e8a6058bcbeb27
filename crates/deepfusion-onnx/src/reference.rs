//! Runs a graph in a simple way, one operation after another, as a reference for faster engines.

use deepfusion_infer::{Activation, Border, Conv, Depthwise, Graph, Op, ValueId, ValueShape};
use deepfusion_kernels::{ConvShape, conv2d, gelu_exact, position_code};

use crate::{DepthMaps, DepthModel, Error};

/// Depth and disparity of a picture.
///
/// # Shapes
/// - `rgb`: H×W×3 bytes of the model's size
/// - output: H×W, row by row
///
/// # Errors
/// [`Error::Length`] for a picture of another size, and as [`DepthModel::validate`].
pub fn depth(model: &DepthModel, rgb: &[u8]) -> Result<DepthMaps, Error> {
    model.validate()?;
    let sigmoid = run(&model.graph, rgb, model.width, model.height)?.swap_remove(0);
    let [far, span] = model.disparity_terms();
    let disparity: Vec<f32> = sigmoid.iter().map(|s| s * span + far).collect();
    Ok(DepthMaps {
        depth: disparity.iter().map(|d| d.recip()).collect(),
        disparity,
    })
}

/// The outputs of a graph for a picture.
///
/// # Shapes
/// - `rgb`: `height` × `width` × 3 bytes
/// - each output: C×H×W, row by row
///
/// # Errors
/// [`Error::Length`] for a picture of another size, [`Error::Network`] for a size that the graph cannot run
/// on.
pub fn run(graph: &Graph, rgb: &[u8], width: usize, height: usize) -> Result<Vec<Vec<f32>>, Error> {
    graph.check_size(width, height)?;
    if rgb.len() != 3 * width * height {
        return Err(Error::Length {
            what: "a picture",
            expected: 3 * width * height,
            found: rgb.len(),
        });
    }
    let plan = Plan {
        graph,
        width,
        height,
    };
    // Index of the last node that reads each value; a value that is no longer needed is dropped.
    let mut last_use = vec![0; graph.nodes().len() + 1];
    for (i, node) in graph.nodes().iter().enumerate() {
        node.op.inputs().for_each(|value| last_use[value.0] = i);
    }
    for output in graph.outputs() {
        last_use[output.0] = usize::MAX;
    }
    let mut values = vec![normalised(graph, rgb)];
    for (i, node) in graph.nodes().iter().enumerate() {
        values.push(plan.value(&node.op, &values));
        for read in node.op.inputs().filter(|read| last_use[read.0] == i) {
            values[read.0] = Vec::new();
        }
    }
    let outputs = graph.outputs().iter();
    Ok(outputs.map(|output| values[output.0].clone()).collect())
}

/// (x/255 − mean) / std, in planes.
fn normalised(graph: &Graph, rgb: &[u8]) -> Vec<f32> {
    let (pixels, _) = rgb.as_chunks::<3>();
    let mut planes = Vec::with_capacity(rgb.len());
    for channel in 0..3 {
        let (mean, std) = (graph.mean()[channel], graph.std()[channel]);
        let value = |pixel: &[u8; 3]| (f32::from(pixel[channel]) / 255.0 - mean) / std;
        planes.extend(pixels.iter().map(value));
    }
    planes
}

struct Plan<'a> {
    graph: &'a Graph,
    width: usize,
    height: usize,
}

impl Plan<'_> {
    /// Channels, height and width of a value.
    fn shape(&self, value: ValueId) -> [usize; 3] {
        let shape = self.graph.shape(value);
        let (w, h) = shape.size(self.width, self.height);
        [shape.channels, h, w]
    }

    fn value(&self, op: &Op, values: &[Vec<f32>]) -> Vec<f32> {
        match op {
            Op::Conv(conv) => self.conv(conv, values),
            Op::MaxPool { input } => max_pool(&values[input.0], self.shape(*input)),
            Op::UpsampleConcat { input, skip } => {
                let mut large = doubled(&values[input.0], self.shape(*input)[2]);
                if let Some(skip) = skip {
                    large.extend_from_slice(&values[skip.0]);
                }
                large
            }
            Op::Concat { inputs } => {
                let parts = inputs.iter().flat_map(|input| &values[input.0]);
                parts.copied().collect()
            }
            Op::GlobalMean { input } => {
                let [_, height, width] = self.shape(*input);
                let area = height * width;
                let planes = values[input.0].chunks_exact(area);
                planes
                    .map(|plane| (sum(plane) / area as f64) as f32)
                    .collect()
            }
            Op::ChannelExtent { input } => {
                let [channels, height, width] = self.shape(*input);
                let (x, area) = (&values[input.0], height * width);
                let along = |p: usize| x[p..].iter().step_by(area).take(channels);
                let mean = (0..area).map(|p| (sum(along(p)) / channels as f64) as f32);
                let most = (0..area).map(|p| along(p).copied().fold(f32::NEG_INFINITY, f32::max));
                mean.chain(most).collect()
            }
            Op::Gate {
                input,
                spatial,
                channel,
                residual,
            } => {
                let [x, spatial, channel] = [input, spatial, channel].map(|v| &values[v.0]);
                let shift = if *residual { 1.0 } else { 0.0 };
                let planes = x.chunks_exact(spatial.len()).zip(channel);
                let gated = planes.flat_map(|(plane, c)| {
                    let pixels = plane.iter().zip(spatial);
                    pixels.map(move |(x, s)| x * (s * c + shift))
                });
                gated.collect()
            }
            Op::AddPixel { input, pixel } => with_pixel(&values[input.0], &values[pixel.0]),
            Op::Multiply { inputs } => {
                let [a, b] = inputs.map(|v| &values[v.0]);
                a.iter().zip(b).map(|(a, b)| a * b).collect()
            }
            Op::Blend {
                state,
                candidate,
                share,
            } => {
                let [h, q, z] = [state, candidate, share].map(|v| &values[v.0]);
                let blended = h.iter().zip(q).zip(z);
                blended.map(|((h, q), z)| h + z * (q - h)).collect()
            }
            Op::ConvexUpsample {
                input,
                weights,
                halvings,
            } => {
                let (value, weights) = (&values[input.0], &values[weights.0]);
                convex(value, weights, self.shape(*input), 1 << halvings)
            }
            Op::DepthToSpace { input } => {
                let small = self.graph.shape(*input);
                let large = ValueShape {
                    halvings: small.halvings.saturating_sub(1),
                    ..small
                };
                let size = large.size(self.width, self.height);
                pixels_of_channels(&values[input.0], self.shape(*input), size)
            }
            Op::Depthwise(op) => depthwise(op, &values[op.input.0], self.shape(op.input)),
            Op::Enlarge { input } => enlarged(&values[input.0], self.shape(*input)),
            Op::ChannelNorm { input, epsilon } => {
                channel_norm(&values[input.0], self.shape(*input), *epsilon)
            }
            Op::CrossCovariance { input, temperature } => {
                cross_covariance(&values[input.0], self.shape(*input), temperature)
            }
            Op::Position { per_axis, halvings } => {
                position_code(*per_axis, self.height >> halvings, self.width >> halvings)
            }
        }
    }

    fn conv(&self, conv: &Conv, values: &[Vec<f32>]) -> Vec<f32> {
        let [_, in_height, in_width] = self.shape(conv.input);
        let shape = ConvShape {
            batch: 1,
            in_channels: conv.channels_in,
            in_height,
            in_width,
            out_channels: conv.channels_out,
            kernel_height: conv.kernel,
            kernel_width: conv.kernel,
            stride: conv.stride,
            padding: conv.reach(),
            dilation: conv.dilation,
            reflect: conv.border == Border::Reflect,
            precision: deepfusion_kernels::Precision::F32,
        };
        let mut y = vec![0.0; shape.out_len()];
        conv2d(
            &shape,
            &values[conv.input.0],
            &conv.weight,
            Some(&conv.bias),
            &mut y,
        );
        if let Some(residual) = conv.residual {
            let residual = &values[residual.0];
            if residual.len() == y.len() {
                y.iter_mut().zip(residual).for_each(|(y, r)| *y += r);
            } else {
                y = with_pixel(&y, residual);
            }
        }
        let activate = |x: f32| match conv.activation {
            Activation::Identity => x,
            Activation::Relu => x.max(0.0),
            Activation::Elu if x > 0.0 => x,
            Activation::Elu => x.exp_m1(),
            Activation::Sigmoid => (1.0 + (-x).exp()).recip(),
            Activation::Gelu => gelu_exact(f64::from(x)) as f32,
            Activation::Tanh => x.tanh(),
            Activation::LeakyRelu => x.max(0.01 * x),
        };
        y.iter_mut().for_each(|y| *y = activate(*y));
        y
    }
}

/// Filters each channel with its own kernel.
fn depthwise(op: &Depthwise, x: &[f32], [_, height, width]: [usize; 3]) -> Vec<f32> {
    let taps = op.kernel * op.kernel;
    let within = |i: usize, k: usize, n: usize| {
        let i = (i * op.stride + k * op.dilation).checked_sub(op.reach())?;
        (i < n).then_some(i)
    };
    let mut y = Vec::with_capacity(x.len() / (op.stride * op.stride));
    let planes = x.chunks_exact(height * width);
    for ((plane, weight), bias) in planes.zip(op.weight.chunks_exact(taps)).zip(&op.bias) {
        for row in 0..height / op.stride {
            for column in 0..width / op.stride {
                let mut sum = f64::from(*bias);
                for (tap, weight) in weight.iter().enumerate() {
                    let down = within(row, tap / op.kernel, height);
                    let across = within(column, tap % op.kernel, width);
                    if let (Some(i), Some(j)) = (down, across) {
                        sum += f64::from(*weight) * f64::from(plane[i * width + j]);
                    }
                }
                y.push(sum as f32);
            }
        }
    }
    y
}

/// Bilinear ×2: three quarters of the nearest pixel and a quarter of the next, along each axis.
fn enlarged(x: &[f32], [_, height, width]: [usize; 3]) -> Vec<f32> {
    let pair = |i: usize, n: usize| {
        let next = if i.is_multiple_of(2) {
            (i / 2).saturating_sub(1)
        } else {
            (i / 2 + 1).min(n - 1)
        };
        (i / 2, next)
    };
    let mut y = Vec::with_capacity(4 * x.len());
    for plane in x.chunks_exact(height * width) {
        for row in 0..2 * height {
            let (near, next) = pair(row, height);
            let along = |column: usize| {
                let (nearest, other) = pair(column, width);
                move |row: usize| {
                    let row = &plane[row * width..][..width];
                    0.75 * f64::from(row[nearest]) + 0.25 * f64::from(row[other])
                }
            };
            y.extend((0..2 * width).map(|column| {
                let of = along(column);
                (0.75 * of(near) + 0.25 * of(next)) as f32
            }));
        }
    }
    y
}

/// Moves four channels to the four pixels of a block, then crops to a size.
fn pixels_of_channels(
    x: &[f32],
    [channels, height, width]: [usize; 3],
    (out_width, out_height): (usize, usize),
) -> Vec<f32> {
    let channels = channels / 4;
    let mut y = Vec::with_capacity(channels * out_width * out_height);
    for channel in 0..channels {
        for row in 0..out_height {
            y.extend((0..out_width).map(|column| {
                let plane = (2 * (row % 2) + column % 2) * channels + channel;
                x[(plane * height + row / 2) * width + column / 2]
            }));
        }
    }
    y
}

/// Each pixel of a block of `side`×`side` as a mean of the pixels around the block's, weighted with the softmax of its nine weights.
fn convex(value: &[f32], weights: &[f32], [_, height, width]: [usize; 3], side: usize) -> Vec<f32> {
    let mut y = Vec::with_capacity(value.len() * side * side);
    for row in 0..height * side {
        for column in 0..width * side {
            let (i, j) = (row / side, column / side);
            let within = row % side * side + column % side;
            let logit = |tap: usize| {
                let channel = tap * side * side + within;
                f64::from(weights[(channel * height + i) * width + j])
            };
            let most = (0..9).map(logit).fold(f64::NEG_INFINITY, f64::max);
            let (mut sum, mut total) = (0.0, 0.0);
            for tap in 0..9 {
                let share = (logit(tap) - most).exp();
                total += share;
                let (down, across) = (i + tap / 3, j + tap % 3);
                if (1..=height).contains(&down) && (1..=width).contains(&across) {
                    sum += share * f64::from(value[(down - 1) * width + across - 1]);
                }
            }
            y.push((sum / total) as f32);
        }
    }
    y
}

/// Normalises each pixel's channels to mean 0 and variance 1.
fn channel_norm(x: &[f32], [channels, height, width]: [usize; 3], epsilon: f32) -> Vec<f32> {
    let area = height * width;
    let along = |p: usize| x[p..].iter().step_by(area).take(channels);
    let statistics = (0..area).map(|p| {
        let mean = sum(along(p)) / channels as f64;
        let squares = along(p).map(|v| (f64::from(*v) - mean).powi(2));
        let variance = squares.sum::<f64>() / channels as f64;
        (mean, (variance + f64::from(epsilon)).sqrt())
    });
    let statistics: Vec<_> = statistics.collect();
    let normalised =
        |(v, (mean, deviation)): (&f32, &(f64, f64))| ((f64::from(*v) - mean) / deviation) as f32;
    let planes = x.chunks_exact(area);
    planes
        .flat_map(|plane| plane.iter().zip(&statistics).map(normalised))
        .collect()
}

/// Each channel as a mixture of its head's values.
fn cross_covariance(
    x: &[f32],
    [channels, height, width]: [usize; 3],
    temperature: &[f32],
) -> Vec<f32> {
    let (area, channels) = (height * width, channels / 3);
    let each = channels / temperature.len();
    let plane = |c: usize| &x[c * area..][..area];
    let dot = |a: usize, b: usize| {
        let products = plane(a).iter().zip(plane(b));
        products
            .map(|(a, b)| f64::from(*a) * f64::from(*b))
            .sum::<f64>()
    };
    let length = |c: usize| (dot(c, c) + 1e-24).sqrt();
    let mut y = Vec::with_capacity(channels * area);
    for c in 0..channels {
        let head = c / each;
        let first = head * each;
        let similar: Vec<f64> = (channels + first..channels + first + each)
            .map(|key| f64::from(temperature[head]) * dot(c, key) / (length(c) * length(key)))
            .collect();
        let most = similar.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = similar.iter().map(|s| (s - most).exp()).collect();
        let whole: f64 = shares.iter().sum();
        let values = 2 * channels + first;
        y.extend((0..area).map(|p| {
            let mixed = shares.iter().enumerate();
            let mixed = mixed.map(|(k, share)| share * f64::from(plane(values + k)[p]));
            (mixed.sum::<f64>() / whole) as f32
        }));
    }
    y
}

/// Sums in double precision, so that the order of many summands has no visible effect.
fn sum<'a>(values: impl IntoIterator<Item = &'a f32>) -> f64 {
    values.into_iter().map(|v| f64::from(*v)).sum()
}

/// Adds to each plane the pixel's value of that channel.
fn with_pixel(x: &[f32], pixel: &[f32]) -> Vec<f32> {
    let planes = x.chunks_exact((x.len() / pixel.len()).max(1)).zip(pixel);
    planes
        .flat_map(|(plane, added)| plane.iter().map(move |x| x + added))
        .collect()
}

/// The maximum over 3×3 pixels around every other pixel; pixels beyond the edge do not count.
fn max_pool(x: &[f32], [_, height, width]: [usize; 3]) -> Vec<f32> {
    let mut y = Vec::with_capacity(x.len() / 4);
    for plane in x.chunks_exact(height * width) {
        for row in 0..height / 2 {
            let rows = (2 * row).saturating_sub(1)..(2 * row + 2).min(height);
            for column in 0..width / 2 {
                let columns = (2 * column).saturating_sub(1)..(2 * column + 2).min(width);
                let values = rows
                    .clone()
                    .flat_map(|r| &plane[r * width..][columns.clone()]);
                y.push(values.copied().fold(f32::NEG_INFINITY, f32::max));
            }
        }
    }
    y
}

/// Doubles every pixel in both directions.
fn doubled(x: &[f32], width: usize) -> Vec<f32> {
    let mut y = Vec::with_capacity(4 * x.len());
    for row in x.chunks_exact(width) {
        let start = y.len();
        y.extend(row.iter().flat_map(|value| [*value; 2]));
        y.extend_from_within(start..);
    }
    y
}
