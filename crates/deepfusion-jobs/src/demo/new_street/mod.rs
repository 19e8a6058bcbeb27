//! Shows a given network zero-shot on a street it has never seen, and what fine-tuning there adds.

mod page;
mod parts;

use std::path::Path;

use deepfusion_model::{TrainConfig, ViewMotion};
use deepfusion_nn::ops::{Precision, supports};
use deepfusion_sim::SimConfig;
use deepfusion_train::Device;

pub use self::page::{NewStreetPage, StreetResult};
pub use self::parts::SplitDrive;

use super::DemoSettings;
use crate::Result;
use crate::training::Start;

/// Added to the demo's seed. What fine-tuning adds differs from street to street: docs/benchmarks/demo.md.
const STREET_SEED: u64 = 21;
/// Number of frames of the drive along the new street (ten per second); every `SCAN_EVERY`-th has a scan.
const FRAMES: usize = 200;
const SCAN_EVERY: usize = 5;
/// Number of cars that drive there.
const MOVING_CARS: usize = 6;
/// Number of fine-tuning steps, and samples per step: about two minutes on two cores.
const STEPS: usize = 60;
const BATCH: usize = 2;
/// Fine-tuning needs a smaller learning rate than training from scratch.
const LEARNING_RATE: f64 = 2e-5;

/// The drive along the new street, with its own camera and light.
#[must_use]
pub fn street(settings: &DemoSettings) -> SimConfig {
    let usual = SimConfig::default();
    let (width, height) = settings.size((usual.width, usual.height));
    SimConfig {
        seed: settings.seed.wrapping_add(STREET_SEED),
        frames: settings.frames(FRAMES),
        width,
        height,
        scan_every: SCAN_EVERY,
        moving_cars: MOVING_CARS,
        varied: true,
        ..usual
    }
}

/// The configuration that fine-tunes on the drive in a folder from images, speed and yaw rate, with the frames of a split file. `own` is
/// the configuration of the network's run, `start` the network.
///
/// # Errors
/// As [`Start::record_in`].
pub fn recipe(
    settings: &DemoSettings,
    (own, start): (&TrainConfig, &Start),
    (drive, split): (&Path, &Path),
    device: &Device,
) -> Result<TrainConfig> {
    let precision = if supports(device, Precision::Bf16) {
        Precision::Bf16
    } else {
        Precision::F32
    };
    let steps = settings.steps(STEPS);
    let mut config = TrainConfig {
        view_motion: ViewMotion::Vehicle,
        // The views are warped by the vehicle's motion, so PoseNet is not used.
        freeze: vec![TrainConfig::POSE_NET.into()],
        precision,
        size: settings.input_size(own.size),
        batch: BATCH,
        steps: Some(steps),
        learning_rate: LEARNING_RATE,
        seed: settings.seed,
        validate_every: steps / 2,
        ..own.preset.config_on(settings.compute)
    };
    // Two pictures of one street give poor batch norm statistics.
    config.depth_net.encoder.frozen_statistics = true;
    config.data.paths = vec![drive.to_owned()];
    config.data.split = Some(split.to_owned());
    start.record_in(&mut config)?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;

    #[test]
    fn the_network_is_trained_only_on_the_first_part() {
        let settings = DemoSettings {
            steps: Some(8),
            size: Some((192, 64)),
            ..DemoSettings::default()
        };
        let drive = (Path::new("street"), Path::new("learned.txt"));
        let own = Preset::Light.config();
        let start = (&own, &Start::Nothing);
        let config = recipe(&settings, start, drive, &Device::flex()).unwrap();
        assert_eq!(config.data.paths, [drive.0]);
        assert_eq!(config.data.split.as_deref(), Some(drive.1));
        assert_eq!((config.size.width, config.size.height), (192, 64));
        assert_eq!((config.steps, config.validate_every), (Some(8), 4));
        assert!(config.leaves_pose_net_out());
        assert_eq!(street(&settings).width, 192);
        assert_eq!(street(&DemoSettings::default()).frames, FRAMES);
    }
}
