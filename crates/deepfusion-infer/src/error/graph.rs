//! Why an operation does not fit into a graph.

use crate::ValueShape;
use deepfusion_hint::count_of;

/// Why an operation does not fit into a graph.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphProblem {
    /// It reads a value that no node before it gives.
    #[error("value {value} does not exist yet")]
    NoSuchValue {
        /// The value: 0 is the image, `i + 1` the output of node `i`.
        value: usize,
    },
    /// It would enlarge beyond the image's own size.
    #[error("larger than the image")]
    LargerThanImage,
    /// No image is so large that it could be halved as often.
    #[error("the {halvings}th halving of the image")]
    Halvings {
        /// How often.
        halvings: u32,
    },
    /// A mean over the image where the image's pixels are needed.
    #[error("a single pixel where an image is expected")]
    SinglePixel,
    /// A mean over the image has no neighbours for a larger kernel.
    #[error("a single pixel takes a 1×1 kernel at stride 1")]
    WindowOnPixel,
    /// A concatenation of no values.
    #[error("nothing to concatenate")]
    NoInput,
    /// A kernel of an even side, or no output channel.
    #[error("kernels are odd, and there is at least one output")]
    EvenKernelOrNoOutput,
    /// Another stride than the engine has.
    #[error("stride {stride}, expected 1 or 2")]
    Stride {
        /// The stride.
        stride: usize,
    },
    /// Taps no distance apart, or farther than any network's.
    #[error("dilation {dilation}, expected 1 to 256")]
    Dilation {
        /// The dilation.
        dilation: usize,
    },
    /// Another number of channels than its weights are for.
    #[error("{} expected, its input has {found}", count_of(*expected, "channel"))]
    Channels {
        /// Those the weights are for.
        expected: usize,
        /// Those of the input.
        found: usize,
    },
    /// More weights than can be counted.
    #[error("more weights than any memory holds")]
    TooManyWeights,
    /// Weights or biases that are not as many as its channels and its kernel take.
    #[error(
        "{} and {} expected, {} and {} given",
        count_of(expected[0], "weight"), count_of(expected[1], "bias"), found[0], found[1]
    )]
    Weights {
        /// Weights and biases that it takes.
        expected: [usize; 2],
        /// Weights and biases that there are.
        found: [usize; 2],
    },
    /// A normalisation's summand that is not above 0.
    #[error("an epsilon of {epsilon}, expected above 0")]
    Epsilon {
        /// The summand.
        epsilon: f32,
    },
    /// Channels that are not queries, keys and values of as many heads.
    #[error("{} for 3 times {}", count_of(*channels, "channel"), count_of(*heads, "head"))]
    Heads {
        /// Channels of the input.
        channels: usize,
        /// Heads.
        heads: usize,
    },
    /// A code of positions in no channel, or in more than any network's.
    #[error("{} an axis, expected 1 to 1024", count_of(*per_axis, "channel"))]
    PositionChannels {
        /// Channels for each axis.
        per_axis: usize,
    },
    /// Channels that are not four for each pixel.
    #[error("{} for 2×2 pixels", count_of(*channels, "channel"))]
    ChannelsForPixels {
        /// Channels of the input.
        channels: usize,
    },
    /// A convex enlargement by nothing, or by too much.
    #[error("an enlargement by 2 to the {halvings}, expected 1 to 3")]
    Enlargement {
        /// The power of two.
        halvings: u32,
    },
    /// A convex enlargement of more than a map.
    #[error("{} enlarged, expected one", count_of(*channels, "channel"))]
    EnlargedChannels {
        /// Channels of the input.
        channels: usize,
    },
    /// What is added or multiplied does not lie in memory as its partner does.
    #[error("its residual or operand is a concatenation, an extent or the image")]
    Operand,
    /// Two values that do not fit each other.
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

/// Two values of an operation whose shapes do not fit each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Misfit {
    /// A spatial mask that is not one channel of its input's size.
    #[error("a spatial mask of {mask:?} on {input:?}")]
    SpatialMask {
        /// The mask.
        mask: ValueShape,
        /// What it acts on.
        input: ValueShape,
    },
    /// What acts on every pixel is no single pixel, or has other channels.
    #[error("{pixel:?} at every pixel of {input:?}")]
    Pixel {
        /// What acts on every pixel.
        pixel: ValueShape,
        /// What it acts on.
        input: ValueShape,
    },
    /// Values that are multiplied or blended, of different shapes.
    #[error("{other:?} combined with {first:?}")]
    Combined {
        /// A later one.
        other: ValueShape,
        /// The first.
        first: ValueShape,
    },
    /// Values that are concatenated, of different sizes.
    #[error("{second:?} appended to {first:?}")]
    Appended {
        /// What is appended.
        second: ValueShape,
        /// What is there already.
        first: ValueShape,
    },
    /// A residual of another shape than the output that it is added to.
    #[error("a residual of {residual:?} on {output:?}")]
    Residual {
        /// The residual.
        residual: ValueShape,
        /// The output.
        output: ValueShape,
    },
    /// Weights of a convex enlargement that are not nine for each new pixel.
    #[error("weights of {found:?}, expected {expected:?}")]
    ConvexWeights {
        /// As they should be.
        expected: ValueShape,
        /// As they are.
        found: ValueShape,
    },
}
