//! The operations that a network's graph is made of.

use crate::ValueId;

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
    /// y = x·Φ(x), Φ the normal distribution.
    Gelu,
    /// y = x where x > 0, x/100 elsewhere.
    LeakyRelu,
    /// y = tanh(x).
    Tanh,
}

/// The border of a convolution's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// Zeros.
    Zero,
    /// The image mirrored at its outermost pixels, which are not repeated.
    Reflect,
}

/// A convolution with square kernels that keeps the size (`kernel` odd, padded by half of its reach) or halves it
/// (`stride` 2, rounding up), then adds a residual and applies an activation: y = a(w ⋆ x + b + r).
#[derive(Debug, Clone, PartialEq)]
pub struct Conv {
    /// Its input.
    pub input: ValueId,
    /// Out × in × kernel × kernel, row-major; batch normalisation folded in.
    pub weight: Vec<f32>,
    /// One value per output channel.
    pub bias: Vec<f32>,
    /// Input channels.
    pub channels_in: usize,
    /// Output channels.
    pub channels_out: usize,
    /// Side of the kernel in pixels, odd.
    pub kernel: usize,
    /// 1 or 2.
    pub stride: usize,
    /// Distance of the kernel's taps in pixels, at least 1.
    pub dilation: usize,
    /// The border of the input.
    pub border: Border,
    /// r, of the output's shape; or a single pixel, which is added everywhere.
    pub residual: Option<ValueId>,
    /// a.
    pub activation: Activation,
}

/// A depthwise convolution, each channel with a kernel of its own and a border of zeros, that keeps the size or halves it
/// (`stride` 2): y = w ⋆ x + b.
#[derive(Debug, Clone, PartialEq)]
pub struct Depthwise {
    /// Its input.
    pub input: ValueId,
    /// Channels × kernel × kernel, row-major; batch normalisation folded in.
    pub weight: Vec<f32>,
    /// One value per channel.
    pub bias: Vec<f32>,
    /// Side of the kernels in pixels, odd.
    pub kernel: usize,
    /// 1 or 2.
    pub stride: usize,
    /// Distance of the kernels' taps in pixels, at least 1.
    pub dilation: usize,
}

/// One operation.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// A convolution.
    Conv(Box<Conv>),
    /// A depthwise convolution.
    Depthwise(Box<Depthwise>),
    /// The maximum over 3×3 pixels at stride 2, padded by one.
    MaxPool {
        /// Its input.
        input: ValueId,
    },
    /// Every pixel becomes 2×2, and the channels of `skip` are appended.
    UpsampleConcat {
        /// The input, which is enlarged.
        input: ValueId,
        /// Appended, twice the size of the input.
        skip: Option<ValueId>,
    },
    /// The channels of several values of one size, one after the other.
    Concat {
        /// At least one.
        inputs: Vec<ValueId>,
    },
    /// The mean over the image: a single pixel.
    GlobalMean {
        /// Its input.
        input: ValueId,
    },
    /// Each pixel's mean and maximum over the channels: two channels.
    ChannelExtent {
        /// Its input.
        input: ValueId,
    },
    /// y = x ⊙ (s · c), or x ⊙ (1 + s · c): attention.
    Gate {
        /// x.
        input: ValueId,
        /// s, one channel.
        spatial: ValueId,
        /// c, a single pixel.
        channel: ValueId,
        /// Whether 1 is added.
        residual: bool,
    },
    /// y = x + v at every pixel.
    AddPixel {
        /// x.
        input: ValueId,
        /// v, a single pixel.
        pixel: ValueId,
    },
    /// Twice the size, bilinearly with half-pixel centres; a pixel at the border is its own neighbour.
    Enlarge {
        /// Its input.
        input: ValueId,
    },
    /// y = (x − μ) / √(σ² + ε), μ and σ² over each pixel's channels: layer normalisation without its factors.
    ChannelNorm {
        /// x.
        input: ValueId,
        /// ε, above 0.
        epsilon: f32,
    },
    /// y = softmax(τ·q̂·k̂ᵀ)·v of each head, rows channels and columns pixels, q̂ and k̂ of length 1: cross-covariance attention.
    CrossCovariance {
        /// Queries, keys and values: three times the output's channels, in each the heads one after the other.
        input: ValueId,
        /// τ of each head.
        temperature: Vec<f32>,
    },
    /// y = a ⊙ b, of one shape.
    Multiply {
        /// a and b.
        inputs: [ValueId; 2],
    },
    /// y = (1 − z) ⊙ h + z ⊙ q, of one shape: how a gated recurrent unit goes on.
    Blend {
        /// h.
        state: ValueId,
        /// q.
        candidate: ValueId,
        /// z.
        share: ValueId,
    },
    /// One channel at 2 to the `halvings` times its size, each pixel a weighted mean of the 3×3 around its place in the small image (zeros
    /// beyond its edge): RAFT's convex upsampling. The weights of a pixel are the softmax of its nine.
    ConvexUpsample {
        /// One channel.
        input: ValueId,
        /// 9·4^`halvings` channels of the input's size: tap by tap (row by row), in each a block's pixels row by row.
        weights: ValueId,
        /// 1 to 3.
        halvings: u32,
    },
    /// Every pixel's channels become 2×2 pixels of a quarter as many: channel (2·i + j)·C + c is channel c of the one at row i and column j.
    /// Cut to the size of a value that is halved once less. After a convolution to 4·C channels this is a transposed one of stride 2.
    DepthToSpace {
        /// Four times the output's channels.
        input: ValueId,
    },
    /// Where each pixel is, in sines and cosines ([`deepfusion_kernels::position_code`]): depends on no other value.
    Position {
        /// Channels for each axis.
        per_axis: usize,
        /// The image's width and height are divided by 2 this many times.
        halvings: u32,
    },
}

impl Depthwise {
    /// Reach of the kernels from their centre, in pixels.
    #[must_use]
    pub fn reach(&self) -> usize {
        (self.kernel / 2).saturating_mul(self.dilation)
    }
}

impl Conv {
    /// Reach of the kernel from its centre, in pixels.
    #[must_use]
    pub fn reach(&self) -> usize {
        (self.kernel / 2).saturating_mul(self.dilation)
    }
}

/// An operation with a name, for messages and for exported files.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its path in the network, such as `encoder.layer1.0.conv1`.
    pub name: String,
    /// The operation.
    pub op: Op,
}

impl Op {
    /// The operation's inputs.
    pub fn inputs(&self) -> impl Iterator<Item = ValueId> {
        let mut several: &[ValueId] = &[];
        let few = match self {
            Self::Conv(conv) => [Some(conv.input), conv.residual, None],
            Self::Depthwise(op) => [Some(op.input), None, None],
            Self::Position { .. } => [None; 3],
            Self::MaxPool { input }
            | Self::Enlarge { input }
            | Self::DepthToSpace { input }
            | Self::ChannelNorm { input, .. }
            | Self::CrossCovariance { input, .. }
            | Self::GlobalMean { input }
            | Self::ChannelExtent { input } => [Some(*input), None, None],
            Self::UpsampleConcat { input, skip } => [Some(*input), *skip, None],
            Self::Concat { inputs } => {
                several = inputs;
                [None; 3]
            }
            Self::Gate {
                input,
                spatial,
                channel,
                ..
            } => [Some(*input), Some(*spatial), Some(*channel)],
            Self::AddPixel { input, pixel } => [Some(*input), Some(*pixel), None],
            Self::Multiply { inputs: [a, b] } => [Some(*a), Some(*b), None],
            Self::Blend {
                state,
                candidate,
                share,
            } => [Some(*state), Some(*candidate), Some(*share)],
            Self::ConvexUpsample { input, weights, .. } => [Some(*input), Some(*weights), None],
        };
        few.into_iter().flatten().chain(several.iter().copied())
    }
}
