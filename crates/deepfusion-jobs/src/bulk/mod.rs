//! Predicts many images, each exactly once: existing outputs are checked, missing ones are made, on any number of machines.
//!
//! An image's sidecar is written last, when its outputs are on the disk: it marks the image as done. [`BulkJob::begin`] decides by the
//! sidecar and the outputs' checksums alone; [`Manifest`]s are for people and tell jobs apart. A [`DepthJob`] holds what all images share.
//! [`predict`] makes their depth; [`perceive`] makes their targets, always all of them and in order. [`pipeline::run`] overlaps reading,
//! the network and writing; [`commit`] writes the sidecars; [`BulkProgress`] counts.

mod camera;
mod committer;
mod depth_job;
mod depth_run;
mod depth_settings;
mod fit;
mod loader;
mod lock;
mod manifest;
pub mod pipeline;
mod progress;
mod records;
mod resume;
mod shard;
mod sidecars;
mod target_run;
#[cfg(test)]
mod tests;
mod video;
mod warnings;

pub use crate::error::UnfitCamera;
pub use camera::{
    CameraFrom, CameraSource, GivenCamera, LensFile, PinholeImage, looks_of_another_size,
};
pub use committer::{Written, commit, queue};
pub use depth_job::{DepthJob, ShowLayers};
pub use depth_run::predict;
pub use depth_settings::DepthSettings;
pub use fit::PoorFit;
pub use loader::{ImageLoader, LoadedImage};
pub use lock::Lock;
pub use manifest::{Entry, Manifest, State};
pub use progress::{BulkProgress, Summary};
pub use records::{RecordLines, record_line, record_lines_path, record_path, write_record};
pub use resume::{BulkJob, StartedJob};
pub use shard::{NoShard, Shard};
pub(crate) use sidecars::outputs_of;
pub use sidecars::{add_output, sidecar_path, write_json, write_unsynced};
pub use target_run::{TargetSummary, WrittenTargets, perceive};
pub use video::{VIDEO_ENDING, write_one_video, write_videos};
pub use warnings::{ImageWarning, Warn};
