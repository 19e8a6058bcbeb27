//! `deepfusion weights …`: lists embedded and importable networks, imports weights, averages runs, packs a run into a file to embed,
//! and calibrates one for int8.

pub(super) mod average;
pub(super) mod calibrate;
#[cfg(feature = "train")]
pub(super) mod import;
pub(super) mod list;
pub(super) mod pack;
