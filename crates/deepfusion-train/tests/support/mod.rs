//! A short simulated drive, and a network small enough to learn from it in seconds.

use deepfusion_data::{Dataset, OpenOptions, save_png};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{Preset, SampleSet, TrainConfig};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A simulated street without scans.
pub(crate) fn street(frames: usize) -> Simulation {
    Simulation::new(&SimConfig {
        seed: 5,
        frames,
        scan_every: 0,
        ..SimConfig::default()
    })
    .unwrap()
}

/// A small network on a short drive, which trains in seconds.
pub(crate) fn small(drive: &Path, steps: usize) -> (TrainConfig, SampleSet, SampleSet) {
    let config = small_without_data(steps);
    let datasets = Dataset::open(drive, &OpenOptions::default()).unwrap();
    let (train, validation, skipped) = SampleSet::split(&config, datasets, None).unwrap();
    assert!(skipped.is_empty());
    (config, train, validation)
}

/// The small network's configuration.
pub(crate) fn small_without_data(steps: usize) -> TrainConfig {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (96, 64);
    config.batch = 2;
    config.steps = Some(steps);
    config.validate_every = 2;
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(8);
    config.depth_net.decoder.widths = [16, 16, 8, 8, 8];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    config
}

/// A KITTI drive along the street.
pub(crate) fn drive(folder: &Path, frames: usize) -> PathBuf {
    write_kitti(&street(frames), folder, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

/// The simulation as a folder of images with speeds and yaw rates, but without a camera.
pub(crate) fn folder_without_camera(simulation: &Simulation, folder: &Path) {
    let images = folder.join("images");
    std::fs::create_dir_all(&images).unwrap();
    let mut times = "time_s,file\n".to_owned();
    let mut speeds = "time_s,speed_mps,yaw_rate_radps\n".to_owned();
    for frame in 0..simulation.frames() {
        let (name, time_s) = (format!("{frame:06}.png"), simulation.time_s(frame));
        save_png(&simulation.frame(frame).rgb, &images.join(&name)).unwrap();
        let oxts = simulation.oxts(frame).values;
        // vf and wu: forward speed, and the yaw rate about the vertical axis.
        let (speed, yaw_rate) = (oxts[8], oxts[22]);
        times += &format!("{time_s:.6},{name}\n");
        speeds += &format!("{time_s:.6},{speed:.9},{yaw_rate:.9}\n");
    }
    std::fs::write(folder.join("frames.csv"), times).unwrap();
    std::fs::write(folder.join("speed.csv"), speeds).unwrap();
    let mount = "[mount]\nforward_m = 1.082\nleft_m = -0.32\nup_m = 0.72\n";
    std::fs::write(folder.join("dataset.toml"), mount).unwrap();
}
