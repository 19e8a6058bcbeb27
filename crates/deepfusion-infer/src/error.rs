use deepfusion_hint::Hint;

use crate::RangesProblem;

mod graph;

pub use self::graph::{GraphProblem, Misfit};

/// What can go wrong before a network runs; running it cannot fail.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A graph that means no network.
    #[error("network graph, node {node} ({name}): {reason}")]
    Graph {
        /// Which node, counted from 0.
        node: usize,
        /// The node's name.
        name: String,
        /// What is wrong with it.
        reason: GraphProblem,
    },
    /// An image size that the graph cannot work on.
    #[error(
        "network input of {width}x{height} pixels: width and height must be multiples of {step}, at least {least}"
    )]
    Size {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// What both must be multiples of.
        step: usize,
        /// The smallest side.
        least: usize,
    },
    /// Images so large that the network's values have no room in memory.
    #[error(
        "network input of {width}x{height} pixels: no memory for its values at this size; choose a smaller one"
    )]
    Memory {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A precision that this processor has no instructions for.
    #[error("bf16 needs a processor with AMX or AVX512-BF16; this one has neither")]
    NoBf16,
    /// The same of int8.
    #[error("int8 needs a processor with AVX512-VNNI and AVX512-BF16; this one has not both")]
    NoInt8,
    /// Int8 without the ranges of what its convolutions read, or with another network's.
    #[error("int8: {reason}")]
    Ranges {
        /// What is wrong with them.
        reason: RangesProblem,
    },
}

impl Hint for Error {
    /// The messages say it themselves.
    fn hint(&self) -> Option<String> {
        None
    }
}
