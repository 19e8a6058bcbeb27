//! Which configurations can train on a recording without a yaw rate.

use deepfusion_data::{Dataset, OpenOptions, RgbImage};
use deepfusion_hint::Hint;
use deepfusion_train::{Error, Preset, SampleSet, TrainConfig, ViewMotion};
use std::fs;

/// Six images at 10 Hz with speeds but no yaw rate.
fn recording() -> (tempfile::TempDir, Dataset) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for n in 0..6 {
        let image = RgbImage::new(64, 48);
        deepfusion_data::save_png(&image, &at(&format!("{n:03}.png"))).unwrap();
    }
    let speeds: String = (0..8)
        .map(|i| format!("{},5\n", f64::from(i) * 0.1))
        .collect();
    fs::write(at("speed.csv"), format!("time_s,speed_mps\n{speeds}")).unwrap();
    fs::write(
        at("dataset.toml"),
        "fps = 10\nintrinsics = [50, 50, 31.5, 23.5]\n",
    )
    .unwrap();
    let mut datasets = Dataset::open(folder.path(), &OpenOptions::default()).unwrap();
    let dataset = datasets.remove(0);
    (folder, dataset)
}

#[test]
fn configurations_that_need_turns_are_refused_and_others_train() {
    let (_folder, dataset) = recording();
    let with = |change: &dyn Fn(&mut TrainConfig)| {
        let mut config = Preset::Tiny.config();
        change(&mut config);
        SampleSet::split(&config, vec![dataset.clone()], None)
    };
    for motion in [ViewMotion::PoseNet, ViewMotion::Distance, ViewMotion::Auto] {
        let split = with(&|config| {
            config.view_motion = motion;
            config.loss.rotation = 0.0;
        });
        let (train, ..) = split.unwrap();
        assert!((train.mean_displacement_m() - 0.5).abs() < 1e-9);
    }
    let vehicle = |config: &mut TrainConfig| config.view_motion = ViewMotion::Vehicle;
    let rotation = |config: &mut TrainConfig| {
        config.view_motion = ViewMotion::PoseNet;
        config.loss.rotation = 0.1;
    };
    let changes: [&dyn Fn(&mut TrainConfig); 2] = [&vehicle, &rotation];
    for change in changes {
        let error = with(change).expect_err("the turns are not known");
        assert!(matches!(error, Error::NoYawRate { .. }), "{error}");
        assert!(error.hint().unwrap().contains("yaw_rate_radps"));
    }
}
