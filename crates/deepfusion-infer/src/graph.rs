//! A network as a list of operations with their weights, for the engine and for export.

use crate::layout::channels_in_memory;
use crate::ranges::{InputRanges, RangesProblem};
use crate::shape::shape_after;
use crate::tile::LANES;
use crate::{Border, Error, GraphProblem, Node, Op, ValueId, ValueShape};

/// A network from an RGB image to one or more outputs.
///
/// The input of the first node is (x − `mean`) / `std` for x in [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    mean: [f32; 3],
    std: [f32; 3],
    nodes: Vec<Node>,
    shapes: Vec<ValueShape>,
    outputs: Vec<ValueId>,
    /// Input ranges of the nodes, if they were calibrated.
    input_ranges: Option<Vec<Option<[f32; 2]>>>,
}

impl Graph {
    /// A graph without operations.
    #[must_use]
    pub fn new(mean: [f32; 3], std: [f32; 3]) -> Self {
        Self {
            mean,
            std,
            nodes: Vec::new(),
            shapes: vec![ValueShape {
                channels: 3,
                halvings: 0,
                pooled: false,
            }],
            outputs: Vec::new(),
            input_ranges: None,
        }
    }

    /// Sets the input ranges of convolutions for [`Precision::Int8`](crate::Precision::Int8). A convolution without a range is computed in
    /// bf16.
    ///
    /// # Errors
    /// [`Error::Ranges`] for a name that no convolution in int8 has (it belongs to another network), or an invalid range.
    pub fn set_input_ranges(&mut self, ranges: &InputRanges) -> Result<(), Error> {
        let mut found = vec![None; self.nodes.len()];
        let computed = self.int8_nodes();
        for (name, [low, high]) in ranges {
            let mut nodes = self.nodes.iter();
            let node = nodes.position(|node| node.name == *name);
            let node = node.filter(|node| computed[*node]);
            let node = node.ok_or_else(|| Error::Ranges {
                reason: RangesProblem::NoSuchConvolution { name: name.clone() },
            })?;
            // The width, too: with two finite ends it may still be infinite.
            if !((high - low).is_finite() && low <= high) {
                return Err(Error::Ranges {
                    reason: RangesProblem::NoRange {
                        name: name.clone(),
                        ends: [*low, *high],
                    },
                });
            }
            found[node] = Some([*low, *high]);
        }
        self.input_ranges = Some(found);
        Ok(())
    }

    /// Names of the convolutions that int8 computes.
    pub fn computed_in_int8(&self) -> impl Iterator<Item = &str> {
        let computed = self.int8_nodes();
        let each = self.nodes.iter().zip(computed);
        each.filter(|(_, computed)| *computed)
            .map(|(node, _)| node.name.as_str())
    }

    /// Whether each node is a convolution for int8. Not among them are the first, whose input is the image; the heads, whose output is the
    /// result; and those whose input channels are not whole vectors in memory.
    fn int8_nodes(&self) -> Vec<bool> {
        let channels = channels_in_memory(self);
        let computed = |node: &Node| {
            let Op::Conv(conv) = &node.op else {
                return false;
            };
            let whole = channels[conv.input.0].is_multiple_of(LANES);
            let head = conv.channels_out == 1;
            conv.input != ValueId::IMAGE && !self.shape(conv.input).pooled && whole && !head
        };
        self.nodes.iter().map(computed).collect()
    }

    /// The input of a node that int8 computes.
    pub(crate) fn input_range(&self, index: usize) -> Option<[f32; 2]> {
        *self.input_ranges.as_ref()?.get(index)?
    }

    /// # Errors
    /// [`Error::Ranges`] for a graph without them.
    pub(crate) fn check_input_ranges(&self) -> Result<(), Error> {
        match &self.input_ranges {
            Some(ranges) if ranges.len() == self.nodes.len() => Ok(()),
            _ => Err(Error::Ranges {
                reason: RangesProblem::NotCalibrated,
            }),
        }
    }

    /// Appends an operation.
    ///
    /// # Errors
    /// [`Error::Graph`] if it does not fit its inputs.
    pub fn push(&mut self, name: impl Into<String>, op: Op) -> Result<ValueId, Error> {
        let name = name.into();
        let shape = shape_after(&self.shapes, &op).map_err(|reason| Error::Graph {
            node: self.nodes.len(),
            name: name.clone(),
            reason,
        })?;
        self.nodes.push(Node { name, op });
        self.shapes.push(shape);
        Ok(ValueId(self.nodes.len()))
    }

    /// Makes a value an output of the graph; the order of calls is the order of outputs.
    ///
    /// # Panics
    /// If there is no such value.
    pub fn add_output(&mut self, value: ValueId) {
        assert!(value.0 < self.shapes.len(), "no value {}", value.0);
        self.outputs.push(value);
    }

    /// Checks that both operands of an addition or multiplication have the same layout of channels, without the gaps of a concatenation.
    ///
    /// # Errors
    /// [`Error::Graph`] naming the first operation whose operand is a concatenation, an extent or the image.
    pub(crate) fn check_operands(&self) -> Result<(), Error> {
        let operands = |op: &Op| match op {
            Op::Conv(conv) => [conv.residual, None, None],
            Op::Gate { input, channel, .. } => [Some(*input), Some(*channel), None],
            Op::AddPixel { input, pixel } => [Some(*input), Some(*pixel), None],
            Op::CrossCovariance { input, .. } | Op::DepthToSpace { input } => {
                [Some(*input), None, None]
            }
            Op::ConvexUpsample { input, weights, .. } => [Some(*input), Some(*weights), None],
            Op::Multiply { inputs: [a, b] } => [Some(*a), Some(*b), None],
            Op::Blend {
                state,
                candidate,
                share,
            } => [Some(*state), Some(*candidate), Some(*share)],
            _ => [None; 3],
        };
        let gappy = |node: &Node| {
            let mut operands = operands(&node.op).into_iter().flatten();
            operands.any(|value| !self.is_plain(value))
        };
        match self.nodes.iter().position(gappy) {
            None => Ok(()),
            Some(node) => Err(Error::Graph {
                node,
                name: self.nodes[node].name.clone(),
                reason: GraphProblem::Operand,
            }),
        }
    }

    /// Whether a value's channels have the layout of a convolution's output.
    fn is_plain(&self, value: ValueId) -> bool {
        match value.0.checked_sub(1).map(|i| &self.nodes[i].op) {
            Some(Op::Conv(_) | Op::CrossCovariance { .. } | Op::Position { .. }) => true,
            Some(Op::Depthwise(op)) => self.is_plain(op.input),
            // A single channel is not padded.
            Some(Op::Enlarge { input }) => self.shape(*input).channels > 1 && self.is_plain(*input),
            Some(
                Op::MaxPool { input }
                | Op::GlobalMean { input }
                | Op::ChannelNorm { input, .. }
                | Op::Gate { input, .. }
                | Op::AddPixel { input, .. }
                | Op::Multiply { inputs: [input, _] }
                | Op::Blend { state: input, .. },
            ) => self.is_plain(*input),
            Some(
                Op::UpsampleConcat { .. }
                | Op::Concat { .. }
                | Op::ChannelExtent { .. }
                // Its channels are not padded.
                | Op::DepthToSpace { .. }
                // Its single channel is not padded.
                | Op::ConvexUpsample { .. },
            )
            | None => false,
        }
    }

    /// Mean that is subtracted from red, green and blue in [0, 1].
    #[must_use]
    pub fn mean(&self) -> [f32; 3] {
        self.mean
    }

    /// Standard deviation by which red, green and blue are divided.
    #[must_use]
    pub fn std(&self) -> [f32; 3] {
        self.std
    }

    /// The operations in an executable order.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The operations, by value, so that weights can be dropped after use.
    pub(crate) fn into_nodes(self) -> Vec<Node> {
        self.nodes
    }

    /// Whether any operation reads the value.
    pub(crate) fn is_read(&self, value: ValueId) -> bool {
        let reads = |node: &Node| node.op.inputs().any(|v| v == value);
        self.nodes.iter().any(reads)
    }

    /// The outputs.
    #[must_use]
    pub fn outputs(&self) -> &[ValueId] {
        &self.outputs
    }

    /// Shape of a value.
    ///
    /// # Panics
    /// If there is no such value.
    #[must_use]
    pub fn shape(&self, value: ValueId) -> ValueShape {
        self.shapes[value.0]
    }

    /// Multiply-adds of each node's convolution, or of its products of channels, for an image of this size, including taps that only read
    /// zeros of the border.
    #[must_use]
    pub fn multiply_adds(&self, width: usize, height: usize) -> Vec<u64> {
        let of = |(i, node): (usize, &Node)| {
            let shape = self.shapes[i + 1];
            let a_pixel = match &node.op {
                Op::Conv(conv) => conv.weight.len(),
                Op::Depthwise(op) => op.weight.len(),
                Op::CrossCovariance { temperature, .. } => {
                    2 * shape.channels * (shape.channels / temperature.len())
                }
                _ => 0,
            };
            let (w, h) = shape.size(width, height);
            let times = |all: u64, side: usize| all.saturating_mul(side as u64);
            [w, h].into_iter().fold(a_pixel as u64, times)
        };
        self.nodes.iter().enumerate().map(of).collect()
    }

    /// How many exact halvings of the image an operation requires. Convolutions round up, and what follows them may be cropped, but
    /// enlargements double the size exactly.
    fn exact_halvings(&self, node: usize, op: &Op) -> u32 {
        match op {
            Op::UpsampleConcat { input, .. }
            | Op::Enlarge { input }
            | Op::ConvexUpsample { input, .. } => self.shapes[input.0].halvings,
            Op::MaxPool { .. } | Op::Depthwise(_) | Op::Position { .. } => {
                self.shapes[node + 1].halvings
            }
            _ => 0,
        }
    }

    /// Checks that the graph can run on images of this size.
    ///
    /// # Errors
    /// [`Error::Size`] unless every halving that must be exact is, and every reflected border has enough pixels to mirror.
    pub fn check_size(&self, width: usize, height: usize) -> Result<(), Error> {
        let nodes = self.nodes.iter().enumerate();
        let deepest = nodes
            .map(|(i, node)| self.exact_halvings(i, &node.op))
            .max();
        let deepest = deepest.unwrap_or(0);
        let step = 1_usize.checked_shl(deepest).unwrap_or(usize::MAX);
        let mirrored = self.nodes.iter().map(|node| match &node.op {
            Op::Conv(conv) if conv.border == Border::Reflect => {
                (conv.reach() + 1) << self.shapes[conv.input.0].halvings
            }
            _ => 0,
        });
        let least = mirrored.fold(step.saturating_mul(2), usize::max);
        let fits = |side: usize| side >= least && side.is_multiple_of(step);
        if fits(width) && fits(height) {
            return Ok(());
        }
        Err(Error::Size {
            width,
            height,
            step,
            least,
        })
    }
}
