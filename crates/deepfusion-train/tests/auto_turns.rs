//! `view_motion = "auto"`: the measured motion where a drive's turns are known, PoseNet's at the measured distance elsewhere.

use crate::support::{drive, folder_without_camera, small_without_data, street};
use burn::tensor::{Device, Tensor};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_train::{
    BatchLoader, Control, LossTerms, Model, RunFolder, SampleSet, Schedule, SnippetBatch,
    TrainConfig, TrainEvent, TrainWarning, Trainer, ViewMotion,
};
use std::fs;
use std::path::Path;

/// The street as a folder with speeds but no yaw rates.
fn without_yaw_rate(folder: &Path, frames: usize) {
    let simulation = street(frames);
    folder_without_camera(&simulation, folder);
    let speeds = fs::read_to_string(folder.join("speed.csv")).unwrap();
    let two_columns = |line: &str| line.rsplit_once(',').unwrap().0.to_owned() + "\n";
    let speeds: String = speeds.lines().map(two_columns).collect();
    fs::write(folder.join("speed.csv"), speeds).unwrap();
    let k = simulation.intrinsics();
    let mount = fs::read_to_string(folder.join("dataset.toml")).unwrap();
    let camera = format!("intrinsics = [{}, {}, {}, {}]\n", k.fx, k.fy, k.cx, k.cy);
    fs::write(folder.join("dataset.toml"), camera + &mount).unwrap();
}

/// A drive whose turns are known and one whose are not, two samples a step.
fn samples(folder: &Path, config: &TrainConfig) -> (SampleSet, SampleSet) {
    let other = folder.join("speeds-alone");
    fs::create_dir(&other).unwrap();
    without_yaw_rate(&other, 8);
    let known = drive(&folder.join("street"), 8);
    let open = |path: &Path| Dataset::open(path, &OpenOptions::default()).unwrap();
    let datasets = [open(&known), open(&other)].concat();
    let (train, validation, skipped) = SampleSet::split(config, datasets, None).unwrap();
    assert!(skipped.is_empty());
    (train, validation)
}

fn settings(motion: ViewMotion) -> TrainConfig {
    let mut config = small_without_data(2);
    config.view_motion = motion;
    config.pose_net.metres_per_unit = 0.8;
    config.validate().unwrap();
    config
}

/// The losses of a batch with one set of weights.
fn losses(model: &Model, motion: ViewMotion, batch: &SnippetBatch) -> LossTerms {
    let device = Device::flex().autodiff();
    let (depth_net, pose_net) = (model.depth_net.clone(), model.pose_net.clone());
    let model = Model::with_networks(&settings(motion), depth_net, pose_net, &device);
    let schedule = Schedule {
        speed_weight: 0.3,
        masks_active: false,
    };
    let pass = model.forward(batch);
    model.loss(&pass, batch, schedule).terms
}

/// The losses are means over the pairs, so a pair adds to the loss of `auto` what it adds to that of `vehicle` or `distance`.
#[test]
fn each_pair_is_treated_by_what_is_known_of_its_drive() {
    let folder = tempfile::tempdir().unwrap();
    let auto = settings(ViewMotion::Auto);
    let (train, _) = samples(folder.path(), &auto);
    let device = Device::flex().autodiff();
    let model = Model::new(&auto, &device).unwrap();
    let loader = BatchLoader::validation(&auto, train);
    // The first drive's samples come first.
    let batch = loader.next(&device).unwrap().unwrap();
    assert!(batch.turns_known.is_none(), "both are known");
    let with = |known: Option<[f32; 2]>| SnippetBatch {
        turns_known: known.map(|known| Tensor::from_data(known, &device)),
        ..batch.clone()
    };
    let of = |known| losses(&model, ViewMotion::Auto, &with(known));
    let same = |what: &str, a: &[LossTerms], b: &[LossTerms]| {
        let sum =
            |terms: &[LossTerms], of: fn(&LossTerms) -> f64| -> f64 { terms.iter().map(of).sum() };
        let terms: [fn(&LossTerms) -> f64; 3] = [|t| t.reprojection, |t| t.speed, |t| t.smoothness];
        for of in terms {
            let (a, b) = (sum(a, of), sum(b, of));
            assert!((a - b).abs() < 1e-6 * b.abs().max(0.1), "{what}: {a}, {b}");
        }
    };
    let vehicle = losses(&model, ViewMotion::Vehicle, &batch);
    let distance = losses(&model, ViewMotion::Distance, &batch);
    assert!((vehicle.reprojection - distance.reprojection).abs() > 1e-4);
    assert!((vehicle.speed - distance.speed).abs() > 1e-3);
    same("known", &[of(None)], &[vehicle]);
    same("known, with a mask", &[of(Some([1.0, 1.0]))], &[vehicle]);
    same("unknown", &[of(Some([0.0, 0.0]))], &[distance]);
    let halves = [of(Some([1.0, 0.0])), of(Some([0.0, 1.0]))];
    same("one of each", &halves, &[vehicle, distance]);
}

#[test]
fn drives_with_and_without_a_yaw_rate_train_together() {
    let folder = tempfile::tempdir().unwrap();
    let config = settings(ViewMotion::Auto);
    let (train, validation) = samples(folder.path(), &config);
    assert_eq!(train.without_turns(), ["speeds-alone"]);

    let loader = BatchLoader::validation(&config, train.clone());
    let device = Device::flex();
    let mut known = Vec::new();
    while let Some(batch) = loader.next(&device) {
        let batch = batch.unwrap();
        match batch.turns_known {
            None => known.extend(vec![1.0; batch.names.len()]),
            Some(some) => known.extend(some.into_data().iter::<f32>()),
        }
    }
    let expected = train
        .samples
        .iter()
        .map(|s| if s.dataset == 0 { 1.0 } else { 0.0 });
    assert_eq!(known, expected.collect::<Vec<f32>>());

    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let mut trainer = Trainer::create(config, run, (train, validation), &device, Ok).unwrap();
    let mut warnings = Vec::new();
    let summary = trainer.run(&mut |event| {
        if let TrainEvent::Warning { warning, .. } = event {
            warnings.push(warning);
        }
        Control::Continue
    });
    assert_eq!(summary.unwrap().step, 2);
    let named = TrainWarning::NoTurns {
        drive: "speeds-alone".into(),
        others: 0,
    };
    let found = warnings.iter().filter(|warning| **warning == named);
    assert_eq!(found.count(), 1, "{warnings:?}");
}
