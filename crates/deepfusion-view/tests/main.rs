//! The viewer's server, its page, and its files for Rerun.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod page;
mod rerun;
mod server;
mod support;
