//! The networks and their operations.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod costs;
mod graph;
mod networks;
mod ops;
