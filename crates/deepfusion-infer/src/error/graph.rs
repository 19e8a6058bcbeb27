//! Why an operation does not fit into a graph.

use crate::ValueShape;
use deepfusion_hint::count_of;

/// Why an operation does not fit into a graph.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphProblem {
    /// The operation reads a value that no previous node computes.
    #[error("value {value} does not exist yet")]
    NoSuchValue {
        /// The value: 0 is the image, `i + 1` the output of node `i`.
        value: usize,
    },
    /// The operation enlarges beyond the image's size.
    #[error("output is larger than the image")]
    LargerThanImage,
    /// The operation halves the image more often than any image can be halved.
    #[error("the image is halved {halvings} times, expected at most 20")]
    Halvings {
        /// Number of halvings.
        halvings: u32,
    },
    /// The operation needs an image, but its input is a mean over the image.
    #[error("input is a single pixel, expected an image")]
    SinglePixel,
    /// A convolution of a single pixel (a mean over the image) has a larger kernel or stride.
    #[error("input is a single pixel, expected a 1×1 kernel at stride 1")]
    WindowOnPixel,
    /// A concatenation without values.
    #[error("nothing to concatenate")]
    NoInput,
    /// A kernel with an even side, or no output channels.
    #[error("expected a kernel with odd sides and at least one output channel")]
    EvenKernelOrNoOutput,
    /// A stride that the engine does not support.
    #[error("stride {stride}, expected 1 or 2")]
    Stride {
        /// The stride.
        stride: usize,
    },
    /// A dilation of 0, or a very large one.
    #[error("dilation {dilation}, expected 1 to 256")]
    Dilation {
        /// The dilation.
        dilation: usize,
    },
    /// A number of input channels that the weights are not for.
    #[error("expected {} of input, found {found}", count_of(*expected, "channel"))]
    Channels {
        /// Number of channels of the weights.
        expected: usize,
        /// Number of channels of the input.
        found: usize,
    },
    /// More weights than can be counted in a `usize`.
    #[error("too many weights for any memory")]
    TooManyWeights,
    /// A number of weights or biases that does not match channels and kernel.
    #[error(
        "expected {} and {}, found {} and {}",
        count_of(expected[0], "weight"), count_of(expected[1], "bias"), found[0], found[1]
    )]
    Weights {
        /// Expected number of weights, and of biases.
        expected: [usize; 2],
        /// Number of weights, and of biases.
        found: [usize; 2],
    },
    /// A normalisation whose epsilon is not above 0.
    #[error("epsilon {epsilon}, expected above 0")]
    Epsilon {
        /// The epsilon.
        epsilon: f32,
    },
    /// A number of channels that is not divisible into queries, keys and values of the heads.
    #[error("{} of input, expected a multiple of 3 × {heads} (queries, keys and values of {})", count_of(*channels, "channel"), count_of(*heads, "head"))]
    Heads {
        /// Number of channels of the input.
        channels: usize,
        /// Number of heads.
        heads: usize,
    },
    /// A positional encoding of no channels, or of too many.
    #[error("{} per axis, expected 1 to 1024", count_of(*per_axis, "channel"))]
    PositionChannels {
        /// Number of channels for each axis.
        per_axis: usize,
    },
    /// A number of channels that is not divisible by the four pixels of a block.
    #[error("{} of input, expected a multiple of 4 (2×2 pixels)", count_of(*channels, "channel"))]
    ChannelsForPixels {
        /// Number of channels of the input.
        channels: usize,
    },
    /// A convex upsampling by a factor of 1, or by too much.
    #[error("convex upsampling by 2 to the power of {halvings}, expected 1 to 3")]
    Enlargement {
        /// The exponent.
        halvings: u32,
    },
    /// A convex upsampling of more than one channel.
    #[error("convex upsampling of {}, expected one", count_of(*channels, "channel"))]
    EnlargedChannels {
        /// Number of channels of the input.
        channels: usize,
    },
    /// An operand whose layout in memory differs from that of the other operand.
    #[error("residual or operand is a concatenation, an extent or the image")]
    Operand,
    /// Two values whose shapes do not match.
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

/// Two operands whose shapes do not match.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Misfit {
    /// A spatial mask that does not have one channel of its input's size.
    #[error("spatial mask of {mask:?} on {input:?}")]
    SpatialMask {
        /// Shape of the mask.
        mask: ValueShape,
        /// Shape of its input.
        input: ValueShape,
    },
    /// The operand for every pixel is not a single pixel, or has other channels.
    #[error(
        "{pixel:?} at every pixel of {input:?}, expected a single pixel with the same number of channels"
    )]
    Pixel {
        /// Shape of the operand for every pixel.
        pixel: ValueShape,
        /// Shape of the other operand.
        input: ValueShape,
    },
    /// Values of different shapes that are multiplied or blended.
    #[error("{other:?} combined with {first:?}")]
    Combined {
        /// Shape of the other value.
        other: ValueShape,
        /// Shape of the first value.
        first: ValueShape,
    },
    /// Values of different sizes that are concatenated.
    #[error("{second:?} appended to {first:?}")]
    Appended {
        /// Shape of the appended value.
        second: ValueShape,
        /// Shape of the value before it.
        first: ValueShape,
    },
    /// A residual whose shape differs from that of the output.
    #[error("residual of {residual:?} on {output:?}")]
    Residual {
        /// Shape of the residual.
        residual: ValueShape,
        /// Shape of the output.
        output: ValueShape,
    },
    /// Weights of a convex upsampling that are not nine for each output pixel.
    #[error("weights of {found:?}, expected {expected:?}")]
    ConvexWeights {
        /// The expected shape.
        expected: ValueShape,
        /// The shape of the weights.
        found: ValueShape,
    },
}
