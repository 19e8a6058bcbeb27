//! Turns a graph into steps over one block of memory: the layout of values and the order of steps.

use std::ops::Range;

use crate::aligned::Aligned;
use crate::conv::{ConvForm, Geometry};
use crate::convex::ConvexUpsample;
use crate::cross_covariance::CrossCovarianceStep;
use crate::depthwise::DepthwiseStep;
use crate::element::Element;
use crate::layout::{Layout, parts};
use crate::masks::Gate;
use crate::stale::stale;
use crate::view::View;
use crate::{Border, Error, Graph, Node, Op, ValueId};
use deepfusion_kernels::position_code;

/// A step of the plan; `C` is the engine's form of a convolution.
#[derive(Debug)]
pub(crate) enum Step<C> {
    /// Writes the normalised image.
    Image(View),
    /// Fills a view's border.
    Border {
        view: View,
        reach: usize,
        kind: Border,
    },
    Conv(C),
    Depthwise(DepthwiseStep),
    MaxPool(View, View),
    Upsample(View, View),
    Copy(View, View),
    GlobalMean(View, View),
    /// The input, the indices of its logical channels, and the output.
    ChannelExtent(View, Vec<Range<usize>>, View),
    Gate(Gate),
    /// The input, the single pixel, and the output.
    AddPixel(View, View, View),
    /// Bilinear enlargement by 2.
    Enlarge(View, View),
    ChannelNorm {
        from: View,
        /// Indices of the logical channels.
        channels: Vec<Range<usize>>,
        epsilon: f32,
        to: View,
    },
    CrossCovariance(CrossCovarianceStep),
    /// Values that are the same for every image, pixel by pixel.
    Constants(Vec<f32>, View),
    /// The two factors, and the output.
    Multiply([View; 2], View),
    /// State, candidate and share, and the output.
    Blend([View; 3], View),
    ConvexUpsample(ConvexUpsample),
    /// Depth to space.
    DepthToSpace(View, View),
}

/// A graph laid out for one image size.
#[derive(Debug)]
pub(crate) struct Plan<C> {
    /// The steps with their names.
    pub(crate) steps: Vec<(String, Step<C>)>,
    /// Ranges of the arena that are read before they are written; cleared before each image.
    pub(crate) stale: Vec<Range<usize>>,
    /// The views of the outputs, and for each of their channels its index in a pixel.
    pub(crate) outputs: Vec<(View, Vec<usize>)>,
}

impl<C> Plan<C> {
    /// Lays the graph out for images of this size (which the graph must accept) in an arena. Each convolution is converted to its form, and
    /// the graph's weights are dropped.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is no memory for the values of such images.
    pub(crate) fn new<E: Element>(
        graph: Graph,
        width: usize,
        height: usize,
    ) -> Result<(Self, Aligned<E>), Error>
    where
        C: ConvForm<E>,
    {
        let mut layout = Layout::new(&graph, size_of::<f32>() / size_of::<E>());
        let outline = outline(&mut layout, &graph);
        let arena = layout.place(width, height, C::overread);
        // Allocated first, as it is the largest.
        let arena = arena.and_then(Aligned::try_zeros);
        let arena = arena.ok_or(Error::Memory { width, height })?;
        let view = |value: ValueId| layout.view(value, width, height);
        let outputs = graph.outputs().iter();
        let outputs = outputs.map(|v| (view(*v), layout.places(*v))).collect();
        let name = |value: ValueId| match value.0.checked_sub(1) {
            Some(node) => graph.nodes()[node].name.clone(),
            None => "image".to_owned(),
        };
        let names: Vec<_> = outline.iter().map(|step| name(step.value())).collect();
        let ranges: Vec<_> = (0..graph.nodes().len())
            .map(|i| graph.input_range(i))
            .collect();
        let mut nodes: Vec<_> = graph.into_nodes().into_iter().map(|n| Some(n.op)).collect();
        let mut step_of = |step: Outline| match step {
            Outline::Image => Step::Image(view(ValueId::IMAGE)),
            Outline::Border(value, reach, kind) => Step::Border {
                view: view(value),
                reach,
                kind,
            },
            Outline::MaxPool(from, to) => Step::MaxPool(view(from), view(to)),
            Outline::Upsample(from, to) => Step::Upsample(view(from), view(to)),
            Outline::Copy(from, to, first) => {
                let mut to = view(to);
                to.offset += first;
                Step::Copy(view(from), to)
            }
            Outline::GlobalMean(from, to) => Step::GlobalMean(view(from), view(to)),
            Outline::ChannelExtent(from, to) => {
                let channels = runs_of(&layout.places(from));
                Step::ChannelExtent(view(from), channels, view(to))
            }
            Outline::Gate(node) => {
                let Some(Op::Gate {
                    input,
                    spatial,
                    channel,
                    residual,
                }) = nodes[node].take()
                else {
                    unreachable!("the outline names each gate once")
                };
                Step::Gate(Gate {
                    input: view(input),
                    spatial: view(spatial),
                    channel: view(channel),
                    residual,
                    out: view(ValueId(node + 1)),
                })
            }
            Outline::AddPixel(from, pixel, to) => Step::AddPixel(view(from), view(pixel), view(to)),
            Outline::Enlarge(from, to) => {
                let mut from = view(from);
                // A single channel is not padded.
                from.channels = from.channels.min(view(to).channels);
                Step::Enlarge(from, view(to))
            }
            Outline::ChannelNorm(from, epsilon, to) => Step::ChannelNorm {
                from: view(from),
                channels: runs_of(&layout.places(from)),
                epsilon,
                to: view(to),
            },
            Outline::Position(per_axis, to) => {
                let channels = layout.places(to);
                let to = view(to);
                Step::Constants(position(per_axis, &channels, &to), to)
            }
            Outline::CrossCovariance(node) => {
                let Some(Op::CrossCovariance { input, temperature }) = nodes[node].take() else {
                    unreachable!("the outline names each attention once")
                };
                let value = ValueId(node + 1);
                Step::CrossCovariance(CrossCovarianceStep {
                    input: view(input),
                    out: view(value),
                    channels: layout.places(value).len(),
                    temperature,
                })
            }
            Outline::Multiply(from, to) => Step::Multiply(from.map(view), view(to)),
            Outline::Blend(from, to) => Step::Blend(from.map(view), view(to)),
            Outline::ConvexUpsample([input, weights], halvings, to) => {
                Step::ConvexUpsample(ConvexUpsample {
                    input: view(input),
                    weights: view(weights),
                    halvings,
                    out: view(to),
                })
            }
            Outline::DepthToSpace(from, to) => Step::DepthToSpace(view(from), view(to)),
            Outline::Depthwise(node) => {
                let Some(Op::Depthwise(op)) = nodes[node].take() else {
                    unreachable!("the outline names each convolution once")
                };
                let channels = &layout.homes[op.input.0].channel_of;
                let (input, out) = (view(op.input), view(ValueId(node + 1)));
                Step::Depthwise(DepthwiseStep::new(&op, input, out, channels))
            }
            Outline::Conv(node) => {
                let Some(Op::Conv(conv)) = nodes[node].take() else {
                    unreachable!("the outline names each convolution once")
                };
                let geometry = Geometry {
                    input: view(conv.input),
                    out: view(ValueId(node + 1)),
                    residual: conv.residual.map(|value| {
                        let residual = view(value);
                        if residual.pixels() == 1 {
                            residual.everywhere()
                        } else {
                            residual
                        }
                    }),
                    kernel: conv.kernel,
                    stride: conv.stride,
                    dilation: conv.dilation,
                    border: conv.border,
                    activation: conv.activation,
                    input_range: ranges[node],
                };
                let channels = &layout.homes[conv.input.0].channel_of;
                Step::Conv(C::new(&conv, geometry, channels))
            }
        };
        let steps = outline.into_iter().map(&mut step_of);
        let steps: Vec<_> = names.into_iter().zip(steps).collect();
        let plan = Self {
            stale: stale(&steps, arena.len()),
            steps,
            outputs,
        };
        Ok((plan, arena))
    }
}

/// A step before the layout is known.
enum Outline {
    Image,
    Border(ValueId, usize, Border),
    Conv(usize),
    MaxPool(ValueId, ValueId),
    Upsample(ValueId, ValueId),
    /// Copies a value into a concatenation, from this channel on.
    Copy(ValueId, ValueId, usize),
    GlobalMean(ValueId, ValueId),
    ChannelExtent(ValueId, ValueId),
    Gate(usize),
    AddPixel(ValueId, ValueId, ValueId),
    Depthwise(usize),
    Enlarge(ValueId, ValueId),
    ChannelNorm(ValueId, f32, ValueId),
    CrossCovariance(usize),
    /// The number of channels for each axis, and the output.
    Position(usize, ValueId),
    Multiply([ValueId; 2], ValueId),
    Blend([ValueId; 3], ValueId),
    /// The value and its weights, the number of doublings, and the output.
    ConvexUpsample([ValueId; 2], u32, ValueId),
    DepthToSpace(ValueId, ValueId),
}

impl Outline {
    /// The value that the step writes, or whose border it fills.
    fn value(&self) -> ValueId {
        match self {
            Self::Image => ValueId::IMAGE,
            Self::Border(value, ..) => *value,
            Self::Conv(node)
            | Self::Gate(node)
            | Self::Depthwise(node)
            | Self::CrossCovariance(node) => ValueId(node + 1),
            Self::MaxPool(_, to)
            | Self::Upsample(_, to)
            | Self::Copy(_, to, _)
            | Self::GlobalMean(_, to)
            | Self::ChannelExtent(_, to)
            | Self::AddPixel(_, _, to)
            | Self::Enlarge(_, to)
            | Self::ChannelNorm(_, _, to)
            | Self::Multiply(_, to)
            | Self::Blend(_, to)
            | Self::ConvexUpsample(_, _, to)
            | Self::DepthToSpace(_, to)
            | Self::Position(_, to) => *to,
        }
    }
}

/// The steps in order. Records each buffer's border and when it is used.
fn outline(layout: &mut Layout, graph: &Graph) -> Vec<Outline> {
    let mut steps = vec![Outline::Image];
    layout.used(ValueId::IMAGE, 0);
    // The content of each value's border.
    let mut borders: Vec<Option<(usize, Border)>> = vec![None; layout.homes.len()];
    for (index, node) in graph.nodes().iter().enumerate() {
        let value = ValueId(index + 1);
        if let Some((input, reach, border)) = window(&node.op) {
            let home = layout.homes[input.0].buffer;
            let there = borders[input.0];
            let enough = there.is_some_and(|(r, b)| b == border && r >= reach);
            if reach > 0 && !enough {
                // Parts of a concatenation share its border.
                for other in 0..borders.len() {
                    if layout.homes[other].buffer == home {
                        borders[other] = None;
                    }
                }
                // Filled once for all convolutions that read it.
                let reach = widest(graph, input, border);
                borders[input.0] = Some((reach, border));
                steps.push(Outline::Border(input, reach, border));
                let buffer = &mut layout.buffers[home];
                buffer.border = buffer.border.max(reach);
            }
        }
        match &node.op {
            Op::Conv(_) => steps.push(Outline::Conv(index)),
            Op::Depthwise(_) => steps.push(Outline::Depthwise(index)),
            Op::Enlarge { input } => steps.push(Outline::Enlarge(*input, value)),
            Op::ChannelNorm { input, epsilon } => {
                steps.push(Outline::ChannelNorm(*input, *epsilon, value));
            }
            Op::CrossCovariance { .. } => steps.push(Outline::CrossCovariance(index)),
            Op::Position { per_axis, .. } => steps.push(Outline::Position(*per_axis, value)),
            Op::MaxPool { input } => steps.push(Outline::MaxPool(*input, value)),
            Op::GlobalMean { input } => steps.push(Outline::GlobalMean(*input, value)),
            Op::ChannelExtent { input } => steps.push(Outline::ChannelExtent(*input, value)),
            Op::Gate { .. } => steps.push(Outline::Gate(index)),
            Op::AddPixel { input, pixel } => {
                steps.push(Outline::AddPixel(*input, *pixel, value));
            }
            Op::Multiply { inputs } => steps.push(Outline::Multiply(*inputs, value)),
            Op::Blend {
                state,
                candidate,
                share,
            } => steps.push(Outline::Blend([*state, *candidate, *share], value)),
            Op::ConvexUpsample {
                input,
                weights,
                halvings,
            } => {
                let from = [*input, *weights];
                steps.push(Outline::ConvexUpsample(from, *halvings, value));
            }
            Op::DepthToSpace { input } => steps.push(Outline::DepthToSpace(*input, value)),
            Op::UpsampleConcat { .. } | Op::Concat { .. } => {
                let mut first = 0;
                for (part, in_place) in parts(graph, value) {
                    if !in_place {
                        steps.push(Outline::Upsample(part, value));
                    } else if !layout.is_stored_in(part, value, first) {
                        steps.push(Outline::Copy(part, value, first));
                    }
                    layout.used(part, steps.len() - 1);
                    first += layout.homes[part.0].channel_of.len();
                }
            }
        }
        for used in node.op.inputs().chain([value]) {
            layout.used(used, steps.len() - 1);
        }
    }
    for output in graph.outputs() {
        layout.used(*output, steps.len());
    }
    steps
}

/// The widest border of this kind that any convolution needs around a value.
fn widest(graph: &Graph, value: ValueId, border: Border) -> usize {
    let reach = |node: &Node| match window(&node.op) {
        Some((input, reach, kind)) if input == value && kind == border => reach,
        _ => 0,
    };
    graph.nodes().iter().map(reach).max().unwrap_or(0)
}

/// The input of a convolution, its reach beyond a pixel, and the kind of border.
fn window(op: &Op) -> Option<(ValueId, usize, Border)> {
    match op {
        Op::Conv(conv) => Some((conv.input, conv.reach(), conv.border)),
        Op::Depthwise(op) => Some((op.input, op.reach(), Border::Zero)),
        _ => None,
    }
}

/// The positional encoding, pixel by pixel, at the indices `channels` of a view's pixel; zeros elsewhere.
fn position(per_axis: usize, channels: &[usize], to: &View) -> Vec<f32> {
    let code = position_code(per_axis, to.height, to.width);
    let mut values = vec![0.0; to.pixels() * to.channels];
    for (plane, place) in code.chunks_exact(to.pixels()).zip(channels) {
        for (pixel, value) in values.chunks_exact_mut(to.channels).zip(plane) {
            pixel[*place] = *value;
        }
    }
    values
}

/// Increasing indices as contiguous ranges.
fn runs_of(places: &[usize]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &place in places {
        match runs.last_mut() {
            Some(run) if run.end == place => run.end += 1,
            _ => runs.push(place..place + 1),
        }
    }
    runs
}
