//! The operations of a network's graph.

use crate::ValueId;

/// An activation function, applied to a convolution's sum.
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
    /// y = x·Φ(x), with Φ the cumulative normal distribution.
    Gelu,
    /// y = x where x > 0, x/100 elsewhere.
    LeakyRelu,
    /// y = tanh(x).
    Tanh,
}

/// How a convolution's input is padded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// With zeros.
    Zero,
    /// By mirroring the image at its outermost pixels, which are not repeated.
    Reflect,
}

/// A convolution with square kernels: y = a(w ⋆ x + b + r). It keeps the size (`kernel` is odd, padded by half of its reach) or, with
/// `stride` 2, halves it, rounding up.
#[derive(Debug, Clone, PartialEq)]
pub struct Conv {
    /// The input x.
    pub input: ValueId,
    /// Weights w: output × input channels × kernel × kernel, row-major; batch normalisation folded in.
    pub weight: Vec<f32>,
    /// Biases b, one per output channel.
    pub bias: Vec<f32>,
    /// Input channels.
    pub channels_in: usize,
    /// Output channels.
    pub channels_out: usize,
    /// Side of the kernel in pixels, odd.
    pub kernel: usize,
    /// Stride, 1 or 2.
    pub stride: usize,
    /// Distance of the kernel's taps in pixels, at least 1.
    pub dilation: usize,
    /// Padding of the input.
    pub border: Border,
    /// Residual r, of the output's shape, or a single pixel that is added everywhere.
    pub residual: Option<ValueId>,
    /// Activation a.
    pub activation: Activation,
}

/// A depthwise convolution, each channel with its own kernel, padded with zeros: y = w ⋆ x + b. It keeps the size or, with `stride` 2,
/// halves it.
#[derive(Debug, Clone, PartialEq)]
pub struct Depthwise {
    /// The input x.
    pub input: ValueId,
    /// Weights w: channels × kernel × kernel, row-major; batch normalisation folded in.
    pub weight: Vec<f32>,
    /// Biases b, one per channel.
    pub bias: Vec<f32>,
    /// Side of the kernels in pixels, odd.
    pub kernel: usize,
    /// Stride, 1 or 2.
    pub stride: usize,
    /// Distance of the kernels' taps in pixels, at least 1.
    pub dilation: usize,
}

/// An operation of a graph.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// A convolution.
    Conv(Box<Conv>),
    /// A depthwise convolution.
    Depthwise(Box<Depthwise>),
    /// The maximum over 3×3 pixels at stride 2, padded by one.
    MaxPool {
        /// The input.
        input: ValueId,
    },
    /// Repeats every pixel 2×2 times, then appends the channels of `skip`.
    UpsampleConcat {
        /// The input to be enlarged.
        input: ValueId,
        /// The value to append, twice the size of the input.
        skip: Option<ValueId>,
    },
    /// Concatenates the channels of several values of the same size.
    Concat {
        /// The values, at least one.
        inputs: Vec<ValueId>,
    },
    /// The mean over the image, a single pixel.
    GlobalMean {
        /// The input.
        input: ValueId,
    },
    /// Each pixel's mean and maximum over the channels: two channels.
    ChannelExtent {
        /// The input.
        input: ValueId,
    },
    /// Attention masks: y = x ⊙ (s · c), or x ⊙ (1 + s · c).
    Gate {
        /// The input x.
        input: ValueId,
        /// Spatial mask s, one channel.
        spatial: ValueId,
        /// Channel mask c, a single pixel.
        channel: ValueId,
        /// Whether 1 is added.
        residual: bool,
    },
    /// Adds a single pixel everywhere: y = x + v.
    AddPixel {
        /// The input x.
        input: ValueId,
        /// The pixel v.
        pixel: ValueId,
    },
    /// Twice the size, bilinearly with half-pixel centres; pixels beyond the border repeat those at the border.
    Enlarge {
        /// The input.
        input: ValueId,
    },
    /// Layer normalisation without scale and offset: y = (x − μ) / √(σ² + ε), μ and σ² over each pixel's channels.
    ChannelNorm {
        /// The input x.
        input: ValueId,
        /// Epsilon ε, above 0.
        epsilon: f32,
    },
    /// Cross-covariance attention: y = softmax(τ·q̂·k̂ᵀ)·v for each head, with channels as rows and pixels as columns, q̂ and k̂ of length
    /// 1.
    CrossCovariance {
        /// Queries, keys and values: three times the output's channels; each of the three has the heads in order.
        input: ValueId,
        /// Temperature τ of each head.
        temperature: Vec<f32>,
    },
    /// The product y = a ⊙ b of two values of the same shape.
    Multiply {
        /// The factors a and b.
        inputs: [ValueId; 2],
    },
    /// The update of a gated recurrent unit: y = (1 − z) ⊙ h + z ⊙ q, all of the same shape.
    Blend {
        /// Previous state h.
        state: ValueId,
        /// Candidate q.
        candidate: ValueId,
        /// Share z.
        share: ValueId,
    },
    /// RAFT's convex upsampling of one channel by a factor of 2 to the power of `halvings`. Each pixel is a weighted mean of the 3×3 pixels
    /// around its place in the small image, with zeros beyond the edge. Its nine weights are a softmax.
    ConvexUpsample {
        /// The input, one channel.
        input: ValueId,
        /// The weights' logarithms, 9·4^`halvings` channels of the input's size: tap by tap (row by row), and for each tap the pixels of a
        /// block row by row.
        weights: ValueId,
        /// Exponent of the factor, 1 to 3.
        halvings: u32,
    },
    /// Depth to space: rearranges every pixel's channels into 2×2 pixels with a quarter as many. Channel (2·i + j)·C + c becomes channel c
    /// of the pixel at row i and column j. The result is cropped to the size of a value that is halved once less. After a convolution to
    /// 4·C channels this is a transposed convolution of stride 2.
    DepthToSpace {
        /// The input, with four times the output's channels.
        input: ValueId,
    },
    /// The position of each pixel as sines and cosines ([`deepfusion_kernels::position_code`]); depends on no other value.
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

/// An operation with a name, for messages and exported files.
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
