//! Every preset learns from known depth, from the vehicle's motion, and from both.

use burn::tensor::Device;
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_nn::weights;
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{
    Control, DataSetConfig, Learn, LossTerms, Preset, RunFolder, SampleSet, TrainConfig,
    TrainEvent, Trainer,
};
use std::ops::ControlFlow;
use std::path::Path;

/// The preset's losses, views and architecture, with few channels and small images.
pub(crate) fn narrow(preset: Preset) -> TrainConfig {
    let mut config = preset.config();
    (config.size.width, config.size.height) = (96, 64);
    config.batch = 2;
    config.steps = Some(1);
    config.learning_rate_warmup_steps = 0;
    let net = &mut config.depth_net;
    // The others do not use a ResNet's settings.
    if net.is_resnet() {
        net.encoder = net.encoder.clone().with_base_width(8);
        net.decoder.widths = [16, 16, 8, 8, 8];
    }
    if let Some(lite_mono) = &mut net.lite_mono {
        lite_mono.widths = [8, 16, 24];
    }
    config.flow_decoder.feature_width = 8;
    config.flow_decoder.widths = vec![8; config.flow_decoder.widths.len()];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    config
}

/// One step on a drive. Returns the losses, and whether the weights of the depth network and of PoseNet changed.
fn step(config: &TrainConfig, drive: &Path, at: &Path) -> (LossTerms, [bool; 2]) {
    let opened = Dataset::open(drive, &OpenOptions::default()).unwrap();
    let recordings = opened.into_iter().map(|d| (0, d)).collect();
    let (train, validation, skipped) = SampleSet::split_sets(config, recordings, None).unwrap();
    assert!(skipped.is_empty());
    let folder = RunFolder::create(at).unwrap();
    let sets = (train, validation);
    let mut trainer = Trainer::create(config.clone(), folder, sets, &Device::flex(), Ok).unwrap();
    let of = |trainer: &Trainer| {
        let model = trainer.model();
        let depth = weights::collect(&model.depth_net).tensors;
        (
            depth,
            weights::collect(model.pose_net.as_ref().unwrap()).tensors,
        )
    };
    let before = of(&trainer);
    let mut found = None;
    let mut listen = |event| {
        if let TrainEvent::Step { losses, .. } = event {
            found = Some(losses);
        }
        Control::Continue
    };
    trainer.run(&mut listen).unwrap();
    let after = of(&trainer);
    assert!(after.0.values().chain(after.1.values()).all(|tensor| {
        let finite = |value: &f32| value.is_finite();
        tensor.values.iter().all(finite)
    }));
    (found.unwrap(), [before.0 != after.0, before.1 != after.1])
}

#[test]
fn every_preset_learns_from_depth_from_motion_and_from_both() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = Simulation::new(&SimConfig {
        seed: 5,
        frames: 12,
        scan_every: 2,
        width: 192,
        height: 128,
        ..SimConfig::default()
    });
    let drive = folder.path().join("drive");
    let drive = write_kitti(&simulation.unwrap(), &drive, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    for preset in Preset::ALL {
        for (learn, motion, depth) in [
            (Learn::Depth, false, true),
            (Learn::OwnMotion, true, false),
            (Learn::Both, true, true),
        ] {
            let mut config = narrow(preset);
            config.data.sets = vec![DataSetConfig {
                name: "drive".into(),
                paths: vec![drive.clone()],
                learn,
                ..DataSetConfig::default()
            }];
            config.validate().unwrap();
            let at = folder.path().join(format!("{preset}-{learn:?}"));
            let (losses, changed) = step(&config, &drive, &at);
            let which = format!("{preset}, {learn:?}: {losses:?}");
            assert!(losses.named().iter().all(|(_, v)| v.is_finite()), "{which}");
            assert_eq!(losses.depth > 0.0, depth, "{which}");
            assert_eq!(losses.reprojection > 0.0, motion, "{which}");
            assert!(losses.total > 0.0, "{which}");
            // PoseNet learns nothing from depth alone.
            assert_eq!(changed, [true, motion], "{which}");
        }
    }
}
