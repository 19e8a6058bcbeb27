//! `deepfusion weights …`: what is embedded, what can be brought in, and how runs become one,
//! or a file to embed, and are calibrated for int8.

pub(super) mod average;
pub(super) mod calibrate;
#[cfg(feature = "train")]
pub(super) mod import;
pub(super) mod list;
pub(super) mod pack;
