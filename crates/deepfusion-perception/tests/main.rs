//! Tests of 3D targets, ground and bad input.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod bad_input;
mod common;
mod drives;
mod ground;
mod instances;
mod sigma;
