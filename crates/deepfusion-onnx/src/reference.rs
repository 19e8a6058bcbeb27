//! Runs a graph in a simple way, one operation after another, as a reference for faster engines.

use deepfusion_infer::{Activation, Border, Conv, Graph, Op, ValueId};
use deepfusion_kernels::{ConvShape, conv2d};

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
    // The last node that reads a value; what nobody reads any more is dropped.
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
        };
        y.iter_mut().for_each(|y| *y = activate(*y));
        y
    }
}

/// In double precision: the order of many summands then does not show.
fn sum<'a>(values: impl IntoIterator<Item = &'a f32>) -> f64 {
    values.into_iter().map(|v| f64::from(*v)).sum()
}

/// Each plane with the pixel's value of that channel added.
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

/// Every pixel becomes 2×2.
fn doubled(x: &[f32], width: usize) -> Vec<f32> {
    let mut y = Vec::with_capacity(4 * x.len());
    for row in x.chunks_exact(width) {
        let start = y.len();
        y.extend(row.iter().flat_map(|value| [*value; 2]));
        y.extend_from_within(start..);
    }
    y
}
