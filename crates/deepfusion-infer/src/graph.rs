//! A network as a list of operations with their weights: what the engine runs and what is exported.

use crate::Error;

/// A value in a [`Graph`]: 0 is the normalised image, `i + 1` is what node `i` gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ValueId(pub usize);

impl ValueId {
    /// The normalised image.
    pub const IMAGE: Self = Self(0);
}

/// Applied to a convolution's sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// y = x.
    Identity,
    /// y = max(x, 0).
    Relu,
    /// y = x where x > 0, eˣ − 1 elsewhere.
    Elu,
    /// y = 1 / (1 + e⁻ˣ).
    Sigmoid,
}

/// What stands beyond the edge of a convolution's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// Zeros.
    Zero,
    /// The image mirrored at its outermost pixels, which are not repeated.
    Reflect,
}

/// A convolution with square kernels that keeps the size (`kernel` odd, padded by half of it) or halves it
/// (`stride` 2), then adds a residual and applies an activation: y = a(w ⋆ x + b + r).
#[derive(Debug, Clone, PartialEq)]
pub struct Conv {
    /// Its input.
    pub input: ValueId,
    /// Out × in × kernel × kernel, row-major; batch normalisation folded in.
    pub weight: Vec<f32>,
    /// One value an output channel.
    pub bias: Vec<f32>,
    /// Input channels.
    pub channels_in: usize,
    /// Output channels.
    pub channels_out: usize,
    /// Side of the kernel in pixels, odd.
    pub kernel: usize,
    /// 1 or 2.
    pub stride: usize,
    /// What the kernel sees beyond the edge.
    pub border: Border,
    /// r, of the output's shape.
    pub residual: Option<ValueId>,
    /// a.
    pub activation: Activation,
}

/// One operation.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// A convolution.
    Conv(Box<Conv>),
    /// The maximum over 3×3 pixels at stride 2, padded by one.
    MaxPool {
        /// Its input.
        input: ValueId,
    },
    /// Every pixel becomes 2×2, and the channels of `skip` are appended.
    UpsampleConcat {
        /// What is enlarged.
        input: ValueId,
        /// Appended, twice the size of the input.
        skip: Option<ValueId>,
    },
}

/// An operation with a name, for messages and for exported files.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its path in the network, such as `encoder.layer1.0.conv1`.
    pub name: String,
    /// What it does.
    pub op: Op,
}

/// Shape of a value, whatever the image's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ValueShape {
    /// Channels.
    pub channels: usize,
    /// The image's width and height are divided by 2 this many times.
    pub halvings: u32,
}

/// A network from an RGB image to one or more outputs.
///
/// The first node sees (x − `mean`) / `std` for x in [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    mean: [f32; 3],
    std: [f32; 3],
    nodes: Vec<Node>,
    shapes: Vec<ValueShape>,
    outputs: Vec<ValueId>,
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
            }],
            outputs: Vec::new(),
        }
    }

    /// Appends an operation.
    ///
    /// # Errors
    /// [`Error::Graph`] where it does not fit what it is given.
    pub fn push(&mut self, name: impl Into<String>, op: Op) -> Result<ValueId, Error> {
        let name = name.into();
        let shape = self.shape_after(&op).map_err(|reason| Error::Graph {
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
    /// When there is no such value.
    pub fn add_output(&mut self, value: ValueId) {
        assert!(value.0 < self.shapes.len(), "no value {}", value.0);
        self.outputs.push(value);
    }

    fn shape_after(&self, op: &Op) -> Result<ValueShape, String> {
        let shape = |value: ValueId| {
            let known = self.shapes.get(value.0).copied();
            known.ok_or_else(|| format!("value {} does not exist yet", value.0))
        };
        match op {
            Op::Conv(conv) => {
                let input = shape(conv.input)?;
                if conv.channels_in != input.channels {
                    return Err(format!(
                        "{} channels expected, its input has {}",
                        conv.channels_in, input.channels
                    ));
                }
                let parts = [conv.channels_in, conv.kernel, conv.kernel];
                let weights = parts
                    .into_iter()
                    .try_fold(conv.channels_out, usize::checked_mul);
                let weights = weights.ok_or("more weights than any memory holds")?;
                if conv.weight.len() != weights || conv.bias.len() != conv.channels_out {
                    return Err(format!(
                        "{} weights and {} biases expected, {} and {} given",
                        weights,
                        conv.channels_out,
                        conv.weight.len(),
                        conv.bias.len()
                    ));
                }
                if conv.kernel % 2 == 0 || conv.channels_out == 0 {
                    return Err("kernels are odd, and there is at least one output".into());
                }
                if !matches!(conv.stride, 1 | 2) {
                    return Err(format!("stride {}, expected 1 or 2", conv.stride));
                }
                let output = ValueShape {
                    channels: conv.channels_out,
                    halvings: halved(input.halvings, conv.stride == 2)?,
                };
                match conv.residual.map(shape).transpose()? {
                    Some(residual) if residual != output => {
                        Err(format!("a residual of {residual:?} on {output:?}"))
                    }
                    _ => Ok(output),
                }
            }
            Op::MaxPool { input } => {
                let input = shape(*input)?;
                Ok(ValueShape {
                    halvings: halved(input.halvings, true)?,
                    ..input
                })
            }
            Op::UpsampleConcat { input, skip } => {
                let input = shape(*input)?;
                let halvings = input.halvings.checked_sub(1);
                let halvings = halvings.ok_or("larger than the image")?;
                let skip = skip.map(shape).transpose()?;
                if let Some(skip) = skip
                    && skip.halvings != halvings
                {
                    return Err(format!("{skip:?} appended to {input:?} enlarged"));
                }
                Ok(ValueShape {
                    channels: input.channels + skip.map_or(0, |s| s.channels),
                    halvings,
                })
            }
        }
    }

    /// That residuals lie as the engine adds them: channel by channel beside the sums, without the gaps of a
    /// concatenation.
    ///
    /// # Errors
    /// [`Error::Graph`] naming the first convolution whose residual is a concatenation or the image.
    pub(crate) fn check_residuals(&self) -> Result<(), Error> {
        let gappy = |node: &Node| match &node.op {
            Op::Conv(conv) => conv.residual.is_some_and(|r| !self.is_convolved(r)),
            _ => false,
        };
        match self.nodes.iter().position(gappy) {
            None => Ok(()),
            Some(node) => Err(Error::Graph {
                node,
                name: self.nodes[node].name.clone(),
                reason: "its residual is a concatenation or the image".into(),
            }),
        }
    }

    /// Whether a value comes from a convolution, maxima between allowed.
    fn is_convolved(&self, value: ValueId) -> bool {
        match value.0.checked_sub(1).map(|i| &self.nodes[i].op) {
            Some(Op::Conv(_)) => true,
            Some(Op::MaxPool { input }) => self.is_convolved(*input),
            Some(Op::UpsampleConcat { .. }) | None => false,
        }
    }

    /// Subtracted from red, green and blue in [0, 1].
    #[must_use]
    pub fn mean(&self) -> [f32; 3] {
        self.mean
    }

    /// What they are then divided by.
    #[must_use]
    pub fn std(&self) -> [f32; 3] {
        self.std
    }

    /// The operations, in an order in which they can run.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The operations alone; a weight can be dropped once it is used.
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
    /// When there is no such value.
    #[must_use]
    pub fn shape(&self, value: ValueId) -> ValueShape {
        self.shapes[value.0]
    }

    /// Multiplications with addition for an image of this size, in 10⁹ operations of two (GFLOP).
    #[must_use]
    pub fn gflop(&self, width: usize, height: usize) -> f64 {
        let of = |(i, node): (usize, &Node)| match &node.op {
            Op::Conv(conv) => {
                let out = self.shapes[i + 1];
                let pixels = (width >> out.halvings) * (height >> out.halvings);
                (conv.weight.len() * pixels) as f64 * 2e-9
            }
            _ => 0.0,
        };
        self.nodes.iter().enumerate().map(of).sum()
    }

    /// That the graph can work on images of this size.
    ///
    /// # Errors
    /// [`Error::Size`] unless every halving is exact and every reflected border has pixels to mirror.
    pub fn check_size(&self, width: usize, height: usize) -> Result<(), Error> {
        let deepest = self.shapes.iter().map(|s| s.halvings).max().unwrap_or(0);
        let step = 1_usize.checked_shl(deepest).unwrap_or(usize::MAX);
        let mirrored = self.nodes.iter().map(|node| match &node.op {
            Op::Conv(conv) if conv.border == Border::Reflect => {
                (conv.kernel / 2 + 1) << self.shapes[conv.input.0].halvings
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

/// One halving more; no image is so large that it could be halved more often.
fn halved(halvings: u32, again: bool) -> Result<u32, String> {
    const MOST: u32 = 20;
    match halvings + u32::from(again) {
        n if n <= MOST => Ok(n),
        n => Err(format!("the {n}th halving of the image")),
    }
}

impl Op {
    /// What the operation reads.
    pub fn inputs(&self) -> impl Iterator<Item = ValueId> {
        let (first, second) = match self {
            Self::Conv(conv) => (conv.input, conv.residual),
            Self::MaxPool { input } => (*input, None),
            Self::UpsampleConcat { input, skip } => (*input, *skip),
        };
        std::iter::once(first).chain(second)
    }
}
