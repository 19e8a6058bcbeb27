//! A short simulated drive, and a network small enough to learn from it in seconds.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]
#![allow(dead_code, reason = "each test takes what it needs")]

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{Preset, SampleSet, TrainConfig};
use std::path::{Path, PathBuf};

/// A street without scans.
pub fn street(frames: usize) -> Simulation {
    Simulation::new(&SimConfig {
        seed: 5,
        frames,
        scan_every: 0,
        ..SimConfig::default()
    })
    .unwrap()
}

/// A small network on a short drive, in seconds.
pub fn small(drive: &Path, steps: usize) -> (TrainConfig, SampleSet, SampleSet) {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (96, 64);
    config.batch = 2;
    config.steps = Some(steps);
    config.validate_every = 2;
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(8);
    config.depth_net.decoder.widths = [16, 16, 8, 8, 8];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    let datasets = Dataset::open(drive, &OpenOptions::default()).unwrap();
    let (train, validation, skipped) = SampleSet::split(&config, datasets, None).unwrap();
    assert!(skipped.is_empty());
    (config, train, validation)
}

/// A KITTI drive along the street.
pub fn drive(folder: &Path, frames: usize) -> PathBuf {
    write_kitti(&street(frames), folder, &mut |_, _| {}).unwrap()
}
