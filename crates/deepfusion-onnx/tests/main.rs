//! Reading and running ONNX files.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod files;
mod runtime;
mod support;
