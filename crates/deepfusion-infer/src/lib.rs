//! A trained network as a graph, and the engine that runs it fast. Nothing here knows Burn.

mod error;
mod graph;

pub use error::Error;
pub use graph::{Activation, Border, Conv, Graph, Node, Op, ValueId, ValueShape};
