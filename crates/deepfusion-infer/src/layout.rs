//! The layout of a graph's values in the arena.

use crate::tile::LANES;
use crate::view::View;
use crate::{Graph, Op, ValueId, ValueShape};

/// A buffer contains one value, or a concatenation together with the values that are its parts.
#[derive(Debug, Clone)]
pub(crate) struct Buffer {
    /// Physical channels.
    channels: usize,
    /// Shape of its values, which all have the same size.
    shape: ValueShape,
    pub(crate) border: usize,
    /// First and last step that uses the buffer.
    live: Option<(usize, usize)>,
    offset: usize,
}

/// The place of a value: some channels of a buffer.
#[derive(Debug, Clone)]
pub(crate) struct Home {
    pub(crate) buffer: usize,
    first: usize,
    /// The logical channel of each physical one; `None` for padding.
    pub(crate) channel_of: Vec<Option<usize>>,
    result: bool,
}

pub(crate) struct Layout {
    pub(crate) buffers: Vec<Buffer>,
    pub(crate) homes: Vec<Home>,
}

impl Layout {
    /// A home for every value. Parts of a concatenation are written to their place in it directly. A result takes `slots` elements.
    pub(crate) fn new(graph: &Graph, slots: usize) -> Self {
        let count = graph.nodes().len() + 1;
        let mut homes: Vec<Option<Home>> = vec![None; count];
        let mut buffers = Vec::new();
        let channels = channels(graph, slots);
        // From the last to the first, as a concatenation comes after its parts.
        for value in (0..count).rev() {
            let channel_of = channels[value].clone();
            let home = homes[value].get_or_insert_with(|| {
                buffers.push(Buffer {
                    channels: channel_of.len(),
                    shape: graph.shape(ValueId(value)),
                    border: 0,
                    live: None,
                    offset: 0,
                });
                Home {
                    buffer: buffers.len() - 1,
                    first: 0,
                    channel_of,
                    result: is_result(graph, ValueId(value)),
                }
            });
            let buffer = home.buffer;
            let mut first = 0;
            for (part, in_place) in parts(graph, ValueId(value)) {
                let free = homes[part.0].is_none() && !is_concat(graph, part);
                if in_place && free && !reads_part_of(graph, part, ValueId(value)) {
                    homes[part.0] = Some(Home {
                        buffer,
                        first,
                        channel_of: channels[part.0].clone(),
                        result: false,
                    });
                }
                first += channels[part.0].len();
            }
        }
        let homes = homes.into_iter().flatten().collect();
        Self { buffers, homes }
    }

    /// Whether a value is stored in a concatenation, from channel `first` on.
    pub(crate) fn is_stored_in(&self, part: ValueId, concat: ValueId, first: usize) -> bool {
        let (part, concat) = (&self.homes[part.0], &self.homes[concat.0]);
        part.buffer == concat.buffer && part.first == concat.first + first
    }

    pub(crate) fn used(&mut self, value: ValueId, step: usize) {
        let live = &mut self.buffers[self.homes[value.0].buffer].live;
        let (first, last) = live.unwrap_or((step, step));
        *live = Some((first.min(step), last.max(step)));
    }

    /// Gives every buffer an offset. Buffers that are never in use at the same time may share memory. Each is followed by as many elements
    /// as kernels may read beyond it: `overread`, given the distance of its pixels. Results come after all buffers: an element that is read
    /// beyond the inputs and multiplied by zero must not be half of an f32, which may be NaN. Returns the total size; `None` if it
    /// overflows.
    pub(crate) fn place(
        &mut self,
        width: usize,
        height: usize,
        overread: impl Fn(usize) -> usize,
    ) -> Option<usize> {
        let mut order: Vec<usize> = (0..self.buffers.len()).collect();
        let size_of = |b: &Buffer| {
            let (width, height) = b.shape.size(width, height);
            let side = |n: usize| n.checked_add(b.border.checked_mul(2)?);
            let pixels = side(width)?.checked_mul(side(height)?)?;
            let all = pixels.checked_mul(b.channels)?;
            let all = all.checked_add(overread(b.channels))?;
            all.checked_next_multiple_of(64)
        };
        let sizes: Vec<usize> = self.buffers.iter().map(size_of).collect::<Option<_>>()?;
        // An upper limit: all buffers side by side. If it does not overflow, no offset below can.
        sizes
            .iter()
            .try_fold(0_usize, |all, s| all.checked_add(*s))?;
        let results: Vec<bool> = (0..self.buffers.len())
            .map(|b| {
                self.homes
                    .iter()
                    .any(|home| home.buffer == b && home.result)
            })
            .collect();
        // Large buffers first, so that the small ones fill the gaps.
        order.sort_by_key(|i| std::cmp::Reverse(sizes[*i]));
        let mut placed: Vec<usize> = Vec::new();
        let mut end = 0;
        for index in order.iter().copied().filter(|i| !results[*i]) {
            let Some(live) = self.buffers[index].live else {
                continue;
            };
            let wanted = sizes[index];
            let together = |other: &&usize| {
                let (first, last) = self.buffers[**other].live.unwrap_or((1, 0));
                first <= live.1 && live.0 <= last
            };
            let mut taken: Vec<(usize, usize)> = placed
                .iter()
                .filter(together)
                .map(|i| (self.buffers[*i].offset, sizes[*i]))
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
        for index in order.into_iter().filter(|i| results[*i]) {
            self.buffers[index].offset = end;
            end += sizes[index];
        }
        Some(end)
    }

    /// Index in a pixel of each logical channel of a value.
    pub(crate) fn places(&self, value: ValueId) -> Vec<usize> {
        let channels = self.homes[value.0].channel_of.iter().enumerate();
        channels.filter_map(|(i, c)| c.map(|_| i)).collect()
    }

    pub(crate) fn view(&self, value: ValueId, width: usize, height: usize) -> View {
        let home = &self.homes[value.0];
        let buffer = &self.buffers[home.buffer];
        let (width, height) = buffer.shape.size(width, height);
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

/// Number of channels of each value in memory, if values are in bf16.
pub(crate) fn channels_in_memory(graph: &Graph) -> Vec<usize> {
    channels(graph, 2).iter().map(Vec::len).collect()
}

/// The logical channel of each value's physical channels; `None` for padding. A result takes `slots` elements.
fn channels(graph: &Graph, slots: usize) -> Vec<Vec<Option<usize>>> {
    let mut all: Vec<Vec<Option<usize>>> = vec![(0..3).map(Some).collect()];
    for (index, node) in graph.nodes().iter().enumerate() {
        let value = ValueId(index + 1);
        let count = graph.shape(value).channels;
        let of = match &node.op {
            Op::Conv(_) | Op::CrossCovariance { .. } | Op::Position { .. } => {
                let physical = if is_result(graph, value) {
                    slots
                } else {
                    count.next_multiple_of(LANES)
                };
                (0..physical).map(|c| (c < count).then_some(c)).collect()
            }
            Op::Enlarge { .. } if count == 1 => vec![Some(0)],
            Op::Depthwise(op) => all[op.input.0].clone(),
            Op::MaxPool { input }
            | Op::Enlarge { input }
            | Op::ChannelNorm { input, .. }
            | Op::GlobalMean { input }
            | Op::Gate { input, .. }
            | Op::AddPixel { input, .. }
            | Op::Multiply { inputs: [input, _] }
            | Op::Blend { state: input, .. } => all[input.0].clone(),
            Op::ConvexUpsample { .. } => vec![Some(0)],
            Op::ChannelExtent { .. } | Op::DepthToSpace { .. } => (0..count).map(Some).collect(),
            Op::UpsampleConcat { .. } | Op::Concat { .. } => {
                let mut joined = Vec::new();
                let mut shift = 0;
                for (part, _) in parts(graph, value) {
                    joined.extend(all[part.0].iter().map(|c| c.map(|c| c + shift)));
                    shift += graph.shape(part).channels;
                }
                joined
            }
        };
        all.push(of);
    }
    all
}

/// The parts of a concatenation, in order, and whether each can be written into it directly; an enlarged part cannot.
pub(crate) fn parts(graph: &Graph, value: ValueId) -> Vec<(ValueId, bool)> {
    match value.0.checked_sub(1).map(|i| &graph.nodes()[i].op) {
        Some(Op::UpsampleConcat { input, skip }) => {
            let skip = skip.map(|skip| (skip, true));
            std::iter::once((*input, false)).chain(skip).collect()
        }
        Some(Op::Concat { inputs }) => inputs.iter().map(|input| (*input, true)).collect(),
        _ => Vec::new(),
    }
}

/// Whether a value is a single channel computed by a convolution without a residual, and no operation reads it.
fn is_result(graph: &Graph, value: ValueId) -> bool {
    let node = value.0.checked_sub(1).map(|i| &graph.nodes()[i].op);
    let plain = matches!(node, Some(Op::Conv(conv)) if conv.residual.is_none());
    plain && graph.shape(value).channels == 1 && !graph.is_read(value)
}

/// Whether a part of a concatenation is a convolution of another part. In one buffer, the elements that it reads beyond its inputs could be
/// its own output.
fn reads_part_of(graph: &Graph, part: ValueId, concat: ValueId) -> bool {
    match part.0.checked_sub(1).map(|i| &graph.nodes()[i].op) {
        Some(Op::Conv(conv)) => parts(graph, concat).iter().any(|p| p.0 == conv.input),
        _ => false,
    }
}

fn is_concat(graph: &Graph, value: ValueId) -> bool {
    let node = value.0.checked_sub(1).map(|i| &graph.nodes()[i].op);
    matches!(node, Some(Op::UpsampleConcat { .. } | Op::Concat { .. }))
}
