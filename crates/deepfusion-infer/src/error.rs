use deepfusion_hint::Hint;

use crate::RangesProblem;

mod graph;

pub use self::graph::{GraphProblem, Misfit};

/// What can go wrong before a network runs. Running it cannot fail.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An invalid graph.
    #[error("network graph, node {node} ({name}): {reason}")]
    Graph {
        /// Index of the node, from 0.
        node: usize,
        /// The node's name.
        name: String,
        /// What is wrong with the node.
        reason: GraphProblem,
    },
    /// An image size that the graph cannot run on.
    #[error(
        "network input of {width}x{height} pixels: width and height must be multiples of {step}, at least {least}"
    )]
    Size {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Width and height must be multiples of this, in pixels.
        step: usize,
        /// Smallest width and height, in pixels.
        least: usize,
    },
    /// Images so large that there is no memory for the network's values.
    #[error(
        "network input of {width}x{height} pixels: not enough memory for its values at this size; choose a smaller one"
    )]
    Memory {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The processor has no instructions for bf16.
    #[error("bf16 needs a processor with AMX or AVX512-BF16; this one has neither")]
    NoBf16,
    /// The processor has no instructions for int8.
    #[error(
        "int8 needs a processor with AVX512-VNNI and AVX512-BF16; this one lacks at least one of them"
    )]
    NoInt8,
    /// Int8 without ranges of its convolutions' inputs, or with those of another network.
    #[error("int8: {reason}")]
    Ranges {
        /// What is wrong with the ranges.
        reason: RangesProblem,
    },
}

impl Hint for Error {
    /// The messages already contain what to do.
    fn hint(&self) -> Option<String> {
        None
    }
}
