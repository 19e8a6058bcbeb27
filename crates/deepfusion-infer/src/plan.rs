//! From a graph to steps over one block of memory: where every value lies, and what happens in which order.

use crate::conv::Geometry;
use crate::tile::LANES;
use crate::view::View;
use crate::{Border, Conv, Graph, Op, ValueId};

/// What a step does; the engine gives each convolution its form.
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
    MaxPool(View, View),
    Upsample(View, View),
    Copy(View, View),
}

/// A graph laid out for one image size.
#[derive(Debug)]
pub(crate) struct Plan<C> {
    /// With their names.
    pub(crate) steps: Vec<(String, Step<C>)>,
    /// Elements of the block of memory.
    pub(crate) arena: usize,
    /// Where the outputs lie, and for each of their channels its place in a pixel.
    pub(crate) outputs: Vec<(View, Vec<usize>)>,
}

/// Elements after a buffer's last pixel that a kernel may read and multiply by zero.
const OVERREAD: usize = 64;

/// A buffer holds one value, or a concatenation with the values that are its parts.
#[derive(Debug, Clone, Default)]
struct Buffer {
    /// Physical channels.
    channels: usize,
    halvings: u32,
    border: usize,
    /// First and last step that uses it.
    live: Option<(usize, usize)>,
    offset: usize,
}

/// A value's place: some channels of a buffer.
#[derive(Debug, Clone)]
struct Home {
    buffer: usize,
    first: usize,
    /// For each physical channel the logical one; none for those that fill up.
    channel_of: Vec<Option<usize>>,
    result: bool,
}

impl<C> Plan<C> {
    /// Lays the graph out for images of this size (which the graph must accept); `init` gives each
    /// convolution its form and may drop its weights.
    pub(crate) fn new<E>(
        graph: Graph,
        width: usize,
        height: usize,
        mut init: impl FnMut(Conv, Geometry, &[Option<usize>]) -> C,
    ) -> Self {
        let mut layout = Layout::new(&graph, size_of::<f32>() / size_of::<E>());
        let outline = layout.outline(&graph);
        let arena = layout.place(width, height);
        let view = |value: ValueId| layout.view(value, width, height);
        let outputs = graph.outputs().iter();
        let outputs = outputs.map(|v| (view(*v), layout.places(*v))).collect();
        let name = |value: ValueId| match value.0.checked_sub(1) {
            Some(node) => graph.nodes()[node].name.clone(),
            None => "image".to_owned(),
        };
        let names: Vec<_> = outline.iter().map(|step| name(step.value())).collect();
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
            Outline::Copy(from, to, behind) => {
                let mut to = view(to);
                to.offset += layout.homes[behind.0].channel_of.len();
                Step::Copy(view(from), to)
            }
            Outline::Conv(node) => {
                let Some(Op::Conv(conv)) = nodes[node].take() else {
                    unreachable!("the outline names each convolution once")
                };
                let geometry = Geometry {
                    input: view(conv.input),
                    out: view(ValueId(node + 1)),
                    residual: conv.residual.map(view),
                    kernel: conv.kernel,
                    stride: conv.stride,
                    activation: conv.activation,
                };
                let channels = &layout.homes[conv.input.0].channel_of;
                Step::Conv(init(*conv, geometry, channels))
            }
        };
        let steps = outline.into_iter().map(&mut step_of);
        let steps = names.into_iter().zip(steps).collect();
        Self {
            steps,
            arena,
            outputs,
        }
    }
}

/// A step before places are known.
enum Outline {
    Image,
    Border(ValueId, usize, Border),
    Conv(usize),
    MaxPool(ValueId, ValueId),
    Upsample(ValueId, ValueId),
    /// A value into the concatenation, behind the value enlarged into it.
    Copy(ValueId, ValueId, ValueId),
}

impl Outline {
    /// What the step writes, or whose border it fills.
    fn value(&self) -> ValueId {
        match self {
            Self::Image => ValueId::IMAGE,
            Self::Border(value, ..) => *value,
            Self::Conv(node) => ValueId(node + 1),
            Self::MaxPool(_, to) | Self::Upsample(_, to) | Self::Copy(_, to, _) => *to,
        }
    }
}

struct Layout {
    buffers: Vec<Buffer>,
    homes: Vec<Home>,
}

impl Layout {
    /// A home for every value: what is appended in a concatenation is written there from the start.
    /// A result takes `slots` elements.
    fn new(graph: &Graph, slots: usize) -> Self {
        let count = graph.nodes().len() + 1;
        let mut homes: Vec<Option<Home>> = vec![None; count];
        let mut buffers = Vec::new();
        let channels = channels(graph, slots);
        // The last ones first: a concatenation's parts come before it.
        for value in (0..count).rev() {
            let channel_of = channels[value].clone();
            let concat = match value.checked_sub(1).map(|i| &graph.nodes()[i].op) {
                Some(Op::UpsampleConcat { input, skip }) => Some((*input, *skip)),
                _ => None,
            };
            let home = homes[value].get_or_insert_with(|| {
                buffers.push(Buffer {
                    channels: channel_of.len(),
                    halvings: graph.shape(ValueId(value)).halvings,
                    ..Buffer::default()
                });
                Home {
                    buffer: buffers.len() - 1,
                    first: 0,
                    channel_of,
                    result: is_result(graph, ValueId(value)),
                }
            });
            let buffer = home.buffer;
            if let Some((input, Some(skip))) = concat
                && home.first == 0
                && homes[skip.0].is_none()
                && !is_concat(graph, skip)
            {
                homes[skip.0] = Some(Home {
                    buffer,
                    first: channels[input.0].len(),
                    channel_of: channels[skip.0].clone(),
                    result: false,
                });
            }
        }
        let homes = homes.into_iter().flatten().collect();
        Self { buffers, homes }
    }

    /// The steps in order; notes how far each buffer's border reaches and when it is used.
    fn outline(&mut self, graph: &Graph) -> Vec<Outline> {
        let mut steps = vec![Outline::Image];
        self.used(ValueId::IMAGE, 0);
        // What stands in each value's border.
        let mut borders: Vec<Option<(usize, Border)>> = vec![None; self.homes.len()];
        for (index, node) in graph.nodes().iter().enumerate() {
            let value = ValueId(index + 1);
            match &node.op {
                Op::Conv(conv) => {
                    let reach = conv.kernel / 2;
                    let wanted = (reach, conv.border);
                    if reach > 0 && borders[conv.input.0] != Some(wanted) {
                        // The parts of a concatenation share its border.
                        for other in 0..borders.len() {
                            if self.homes[other].buffer == self.homes[conv.input.0].buffer {
                                borders[other] = None;
                            }
                        }
                        borders[conv.input.0] = Some(wanted);
                        steps.push(Outline::Border(conv.input, reach, conv.border));
                    }
                    let buffer = &mut self.buffers[self.homes[conv.input.0].buffer];
                    buffer.border = buffer.border.max(reach);
                    steps.push(Outline::Conv(index));
                }
                Op::MaxPool { input } => steps.push(Outline::MaxPool(*input, value)),
                Op::UpsampleConcat { input, skip } => {
                    steps.push(Outline::Upsample(*input, value));
                    if let Some(skip) = skip
                        && self.homes[skip.0].buffer != self.homes[value.0].buffer
                    {
                        steps.push(Outline::Copy(*skip, value, *input));
                        self.used(*skip, steps.len() - 1);
                    }
                }
            }
            for input in node.op.inputs().chain([value]) {
                self.used(input, steps.len() - 1);
            }
        }
        for output in graph.outputs() {
            self.used(*output, steps.len());
        }
        steps
    }

    fn used(&mut self, value: ValueId, step: usize) {
        let live = &mut self.buffers[self.homes[value.0].buffer].live;
        let (first, last) = live.unwrap_or((step, step));
        *live = Some((first.min(step), last.max(step)));
    }

    /// Gives every buffer an offset; buffers that are never alive together may share memory. Results lie
    /// behind them all: a kernel that reads on past a buffer's end, times zero, must not meet the halves of
    /// an f32, which may be no number. Returns the size of the whole.
    fn place(&mut self, width: usize, height: usize) -> usize {
        let mut order: Vec<usize> = (0..self.buffers.len()).collect();
        let size = |b: &Buffer| {
            let side = |n: usize| (n >> b.halvings) + 2 * b.border;
            (side(width) * side(height) * b.channels + OVERREAD).next_multiple_of(64)
        };
        let results: Vec<bool> = (0..self.buffers.len())
            .map(|b| {
                self.homes
                    .iter()
                    .any(|home| home.buffer == b && home.result)
            })
            .collect();
        // Large ones first: the small ones fill the gaps.
        order.sort_by_key(|i| std::cmp::Reverse(size(&self.buffers[*i])));
        let mut placed: Vec<usize> = Vec::new();
        let mut end = 0;
        for index in order.iter().copied().filter(|i| !results[*i]) {
            let Some(live) = self.buffers[index].live else {
                continue;
            };
            let wanted = size(&self.buffers[index]);
            let together = |other: &&usize| {
                let (first, last) = self.buffers[**other].live.unwrap_or((1, 0));
                first <= live.1 && live.0 <= last
            };
            let mut taken: Vec<(usize, usize)> = placed
                .iter()
                .filter(together)
                .map(|i| (self.buffers[*i].offset, size(&self.buffers[*i])))
                .collect();
            taken.sort_unstable();
            let mut offset = 0;
            for (start, length) in taken {
                if offset + wanted <= start {
                    break;
                }
                offset = offset.max(start + length);
            }
            self.buffers[index].offset = offset;
            end = end.max(offset + wanted);
            placed.push(index);
        }
        end += self.slack();
        for index in order.into_iter().filter(|i| results[*i]) {
            self.buffers[index].offset = end;
            end += size(&self.buffers[index]);
        }
        end
    }

    /// Elements after the last buffer that kernels may read, and multiply by zero or drop: whole vectors,
    /// and pixels that fill up a tile.
    fn slack(&self) -> usize {
        let widest = self.buffers.iter().map(|b| b.channels).max().unwrap_or(0);
        (40 * widest + 1024).next_multiple_of(64)
    }

    /// Where each logical channel of a value lies in a pixel.
    fn places(&self, value: ValueId) -> Vec<usize> {
        let channels = self.homes[value.0].channel_of.iter().enumerate();
        channels.filter_map(|(i, c)| c.map(|_| i)).collect()
    }

    fn view(&self, value: ValueId, width: usize, height: usize) -> View {
        let home = &self.homes[value.0];
        let buffer = &self.buffers[home.buffer];
        let (width, height) = (width >> buffer.halvings, height >> buffer.halvings);
        let pitch = buffer.channels;
        let row = (width + 2 * buffer.border) * pitch;
        View {
            offset: buffer.offset + buffer.border * (row + pitch) + home.first,
            row,
            pitch,
            width,
            height,
            channels: home.channel_of.len(),
            border: buffer.border,
            result: home.result,
        }
    }
}

/// For each value and each of its physical channels the logical one; none for those that fill up. A result takes
/// `slots` elements.
fn channels(graph: &Graph, slots: usize) -> Vec<Vec<Option<usize>>> {
    let mut all: Vec<Vec<Option<usize>>> = vec![(0..3).map(Some).collect()];
    for (index, node) in graph.nodes().iter().enumerate() {
        let value = ValueId(index + 1);
        let count = graph.shape(value).channels;
        let of = match &node.op {
            Op::Conv(_) => {
                let physical = if is_result(graph, value) {
                    slots
                } else {
                    count.next_multiple_of(LANES)
                };
                (0..physical).map(|c| (c < count).then_some(c)).collect()
            }
            Op::MaxPool { input } => all[input.0].clone(),
            Op::UpsampleConcat { input, skip } => {
                let shift = graph.shape(*input).channels;
                let behind = skip.map_or(&[][..], |skip| &all[skip.0]);
                let behind = behind.iter().map(|c| c.map(|c| c + shift));
                all[input.0].iter().copied().chain(behind).collect()
            }
        };
        all.push(of);
    }
    all
}

/// A single channel that a convolution without a residual gives and nothing reads.
fn is_result(graph: &Graph, value: ValueId) -> bool {
    let node = value.0.checked_sub(1).map(|i| &graph.nodes()[i].op);
    let plain = matches!(node, Some(Op::Conv(conv)) if conv.residual.is_none());
    plain && graph.shape(value).channels == 1 && !graph.is_read(value)
}

fn is_concat(graph: &Graph, value: ValueId) -> bool {
    let node = value.0.checked_sub(1).map(|i| &graph.nodes()[i].op);
    matches!(node, Some(Op::UpsampleConcat { .. }))
}
