//! A trained network as a graph, and a fast engine that runs it. Independent of Burn.

mod activate;
mod aligned;
#[cfg(target_arch = "x86_64")]
mod bf16;
mod channel_norm;
mod conv;
mod convex;
mod cross_covariance;
mod depthwise;
mod direct;
mod dispatch;
mod element;
mod engine;
mod enlarge;
mod error;
mod forms;
mod graph;
mod head;
#[cfg(target_arch = "x86_64")]
mod int8;
mod layout;
mod masks;
mod means;
mod movement;
mod op;
mod plan;
mod ranges;
mod recurrent;
mod scratch;
mod shape;
mod stale;
#[cfg(test)]
mod tests;
mod tile;
mod value;
mod view;
mod winograd;
mod winograd_tiles;

pub use engine::{Engine, EnginePlan, Precision};
pub use error::{Error, GraphProblem, Misfit};
pub use graph::Graph;
pub use op::{Activation, Border, Conv, Depthwise, Node, Op};
pub use ranges::{InputRanges, RangesProblem, SeenInputs};
pub use value::{ValueId, ValueShape};
