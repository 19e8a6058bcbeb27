//! Calibration of a camera from pictures of a board.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod cameras;
mod opencv;
