//! Other projects' weights as a run: which are known and, with the feature `train`, how to make a run of them.

#[cfg(feature = "train")]
mod foreign_network;
mod known;

#[cfg(feature = "train")]
pub use self::foreign_network::ForeignNetwork;
pub use self::known::{KNOWN, KnownWeights};
