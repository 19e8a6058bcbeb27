//! A vehicle's signals out of the frames of its CAN bus.
//!
//! [`Dbc`] reads the maker's description (or a community's); [`CanSignal`] can also be written into a
//! configuration by hand. [`CanSignal::over_time`] makes a [`crate::Signal`] of a recording.

mod dbc;
mod layout;
mod signal;

pub use dbc::Dbc;
pub use layout::{BitLayout, ByteOrder, Number};
pub use signal::{CanFrame, CanId, CanSignal, MultiplexCondition};
