//! `deepfusion weights …`: what is embedded, what can be brought in, and how a run becomes a file to embed.

#[cfg(feature = "train")]
pub mod import;
pub mod list;
pub mod pack;
