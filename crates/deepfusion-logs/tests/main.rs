//! Logs of vehicles.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod blf;
mod formats;
mod tracks;
