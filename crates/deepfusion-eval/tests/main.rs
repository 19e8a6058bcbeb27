//! Tests of the metrics, many against other people's code.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod comparison;
mod files_and_texts;
mod odometry;
mod points;
mod properties;
mod reference;
mod sharpness;
