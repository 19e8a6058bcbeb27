//! `deepfusion weights …`: what is embedded, what can be brought in, and how a run becomes a file to embed
//! and is calibrated for int8.

pub(super) mod calibrate;
#[cfg(feature = "train")]
pub(super) mod import;
pub(super) mod list;
pub(super) mod pack;
