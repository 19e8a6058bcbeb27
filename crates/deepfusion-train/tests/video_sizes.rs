//! Video whose images are resized to several input sizes.

use burn::tensor::{Device, Tensor};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_model::InputSize;
use deepfusion_train::{
    BatchLoader, Control, LossTerms, Preset, RunFolder, SampleSet, SnippetBatch, TrainConfig,
    TrainEvent, Trainer,
};
use std::path::Path;

use crate::presets::narrow;
use crate::support;

const OWN: InputSize = InputSize {
    width: 96,
    height: 64,
};
const OTHERS: [InputSize; 2] = [
    InputSize {
        width: 64,
        height: 96,
    },
    InputSize {
        width: 128,
        height: 64,
    },
];

fn settings(preset: Preset) -> TrainConfig {
    let mut config = narrow(preset);
    config.canonical_focal_px = Some(60.0);
    config.augmentation.video_sizes = OTHERS.to_vec();
    config
}

fn samples(config: &TrainConfig, drive: &Path) -> (SampleSet, SampleSet) {
    let datasets = Dataset::open(drive, &OpenOptions::default()).unwrap();
    let (train, validation, skipped) = SampleSet::split(config, datasets, None).unwrap();
    assert!(skipped.is_empty());
    (train, validation)
}

fn losses(trainer: &mut Trainer, until: Option<usize>) -> Vec<LossTerms> {
    let mut steps = Vec::new();
    let mut listen = |event| {
        if let TrainEvent::Step { losses, step, .. } = event {
            steps.push(losses);
            if Some(step) == until {
                return Control::Stop;
            }
        }
        Control::Continue
    };
    trainer.run(&mut listen).unwrap();
    steps
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

/// Images, camera and metres of a batch fit its size. Held-out images keep the run's size.
#[test]
fn images_camera_and_metres_of_a_batch_fit_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let drive = support::drive(&folder.path().join("drive"), 12);
    let mut config = settings(Preset::Tiny);
    config.augmentation.flip = false;
    let (train, validation) = samples(&config, &drive);
    let camera = train.camera().unwrap();
    let loader = BatchLoader::training(&config, train, 0);
    let focals: Vec<f64> = [OWN, OTHERS[0], OWN, OTHERS[1], OWN]
        .into_iter()
        .map(|size| {
            let batch = loader.next(&Device::flex()).unwrap().unwrap();
            focal_of(&batch, size, camera)
        })
        .collect();
    assert_eq!((focals[0], focals[0]), (focals[2], focals[4]));
    // An image that is half as tall again looks as if taken with 1.5 times the focal length.
    assert!((focals[1] / focals[0] - 1.5).abs() < 1e-6, "{focals:?}");
    assert!((focals[3] / focals[0] - 1.0).abs() < 1e-6, "{focals:?}");

    let held_out = BatchLoader::validation(&config, validation);
    while let Some(batch) = held_out.next(&Device::flex()) {
        let batch = batch.unwrap();
        let expected = [batch.len(), 3, OWN.height, OWN.width];
        assert_eq!(batch.clean[0].dims(), expected);
    }
}

/// The factor of depth in a batch, after a check of the batch's size.
fn focal_of(batch: &SnippetBatch, size: InputSize, camera: deepfusion_geometry::Intrinsics) -> f64 {
    let InputSize { width, height } = size;
    for image in batch.clean.iter().chain(&batch.network) {
        assert_eq!(image.dims(), [batch.len(), 3, height, width]);
    }
    let expected = camera.resized(width as u32, height as u32).matrix();
    for k in values(batch.intrinsics.clone()).chunks_exact(9) {
        for (i, value) in k.iter().enumerate() {
            let expected = expected[(i / 3, i % 3)];
            assert!((f64::from(*value) - expected).abs() < 1e-3, "{k:?}");
        }
    }
    let range = settings(Preset::Tiny).depth_net.range;
    let factors = batch.factors.as_ref().unwrap();
    let nearest_zero = values(factors.nearest_zero.clone())[0];
    1.0 / (f64::from(nearest_zero) * range.max_m)
}

/// Every network and every loss takes a step at the run's size and at another.
#[test]
fn every_preset_learns_at_several_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let drive = support::drive(&folder.path().join("drive"), 8);
    for preset in Preset::ALL {
        let mut config = settings(preset);
        config.steps = Some(2);
        let sets = samples(&config, &drive);
        let run = RunFolder::create(&folder.path().join(preset.name())).unwrap();
        let mut trainer = Trainer::create(config, run, sets, &Device::flex(), Ok).unwrap();
        let steps = losses(&mut trainer, None);
        assert_eq!(steps.len(), 2, "{preset}");
        for step in steps {
            assert!(
                step.total.is_finite() && step.reprojection > 0.0,
                "{preset}"
            );
        }
    }
}

/// A run that is stopped before a batch of another size and resumed equals an uninterrupted one.
#[test]
fn a_resumed_run_has_the_same_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let drive = support::drive(&folder.path().join("drive"), 12);
    let mut config = settings(Preset::Tiny);
    config.steps = Some(4);
    let create = |name: &str| {
        let run = RunFolder::create(&folder.path().join(name)).unwrap();
        let sets = samples(&config, &drive);
        Trainer::create(config.clone(), run, sets, &Device::flex(), Ok).unwrap()
    };
    let whole = losses(&mut create("whole"), None);
    let mut begun = losses(&mut create("parts"), Some(1));
    let (run, _) = RunFolder::open(&folder.path().join("parts")).unwrap();
    let stored = run.read_config().unwrap();
    assert_eq!(stored.augmentation.video_sizes, OTHERS);
    let sets = samples(&stored, &drive);
    let mut resumed = Trainer::resume(stored, run, sets, &Device::flex()).unwrap();
    begun.extend(losses(&mut resumed, None));
    assert_eq!(begun, whole);
}

/// Without a canonical focal length, a disparity would stand for the same depth at every size. A size must also be valid for the networks.
#[test]
fn invalid_sizes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let drive = support::drive(&folder.path().join("drive"), 8);
    let mut config = settings(Preset::Tiny);
    config.canonical_focal_px = None;
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let sets = samples(&config, &drive);
    let error = Trainer::create(config.clone(), run, sets, &Device::flex(), Ok).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("augmentation.video_sizes"), "{error}");
    config.canonical_focal_px = Some(60.0);
    config.validate().unwrap();
    config.augmentation.video_sizes[0].width = 100;
    assert!(config.validate().is_err());
}
