//! Decodes a vehicle's signals from the frames of its CAN bus.
//!
//! [`Dbc`] reads the manufacturer's description (or a community's); a [`CanSignal`] can also be
//! written into a configuration by hand. [`CanSignal::decode`] reads its value from a frame.

mod dbc;
mod layout;
mod signal;

pub use crate::error::{DbcProblem, ExpectedLayout, SignalProblem};
pub use dbc::Dbc;
pub use layout::{BitLayout, ByteOrder, Number};
pub use signal::{CanFrame, CanId, CanSignal, MultiplexCondition};
