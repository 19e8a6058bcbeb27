//! A trained network as a graph, and the engine that runs it fast. Nothing here knows Burn.

mod activate;
mod conv;
mod direct;
mod element;
mod engine;
mod error;
mod graph;
mod head;
mod movement;
mod plan;
mod tile;
mod view;
mod winograd;

pub use engine::Engine;
pub use error::Error;
pub use graph::{Activation, Border, Conv, Graph, Node, Op, ValueId, ValueShape};
