//! The `deepfusion` command.
fn main() {}
