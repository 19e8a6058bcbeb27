//! The trainer's events, and how runs end.

use crate::support::{drive, small};
use burn::tensor::Device;
use deepfusion_hint::Hint;
use deepfusion_nn::weights::{WeightTensor, collect};
use deepfusion_train::{
    BatchLoader, Control, Error, Model, RunFolder, SampleSet, Schedule, TrainConfig, TrainEvent,
    TrainSummary, Trainer, ViewMotion, losses, validation_loss,
};
use std::collections::BTreeMap;
use std::path::Path;

type Tensors = BTreeMap<String, WeightTensor>;

fn started(at: &Path, config: TrainConfig, sets: (SampleSet, SampleSet)) -> Result<Trainer, Error> {
    let folder = RunFolder::create(&at.join("run")).unwrap();
    Trainer::create(config, folder, sets, &Device::flex(), Ok)
}

fn events(trainer: &mut Trainer) -> (Vec<TrainEvent>, TrainSummary) {
    let mut events = Vec::new();
    let summary = trainer
        .run(&mut |event| {
            events.push(event);
            Control::Continue
        })
        .unwrap();
    (events, summary)
}

/// Samples of a recording that does not exist: making a batch of them panics.
fn broken(samples: &SampleSet) -> SampleSet {
    let mut broken = samples.clone();
    for sample in &mut broken.samples[1..] {
        sample.dataset = 99;
    }
    broken
}

#[test]
fn a_loader_that_dies_is_an_error_in_training_and_in_validation() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, train, validation) = small(&drive(&folder.path().join("street"), 8), 1);
    config.pose_net.metres_per_unit = 0.8;
    let device = Device::flex().autodiff();
    let model = Model::new(&config, &device).unwrap();
    let error = validation_loss(&model, &config, &broken(&train), &device).unwrap_err();
    assert!(matches!(error, Error::Loader { .. }), "{error}");
    assert!(
        error.to_string().contains("batch 0: index out of bounds"),
        "{error}"
    );
    assert!(error.hint().is_some());

    let mut trainer = started(folder.path(), config, (broken(&train), validation)).unwrap();
    let error = trainer.run(&mut |_| Control::Continue).unwrap_err();
    assert!(matches!(error, Error::Loader { .. }), "{error}");
}

#[test]
fn a_finished_loader_stays_finished() {
    let folder = tempfile::tempdir().unwrap();
    let (config, train, _) = small(&drive(folder.path(), 8), 1);
    let device = Device::flex();
    let loader = BatchLoader::validation(&config, train.clone());
    let mut seen = 0;
    while let Some(batch) = loader.next(&device) {
        seen += batch.unwrap().len();
    }
    assert_eq!(seen, train.samples.len());
    assert!(loader.next(&device).is_none());
}

#[test]
fn no_held_out_samples_are_an_error_unless_configured() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, train, validation) = small(&drive(&folder.path().join("street"), 8), 1);
    config.pose_net.metres_per_unit = 0.8;
    let nothing = SampleSet {
        samples: Vec::new(),
        ..validation.clone()
    };
    let device = Device::flex().autodiff();
    let model = Model::new(&config, &device).unwrap();
    let error = validation_loss(&model, &config, &nothing, &device).unwrap_err();
    assert!(matches!(error, Error::NoSamples { .. }), "{error}");

    let at = |name: &str| folder.path().join(name);
    let start = |name: &str, config: &TrainConfig, train: &SampleSet| {
        std::fs::create_dir(at(name)).unwrap();
        started(&at(name), config.clone(), (train.clone(), nothing.clone()))
    };
    let error = start("a", &config, &train).unwrap_err();
    assert!(matches!(error, Error::NoValidation), "{error}");
    assert!(error.hint().unwrap().contains("longer drives"));
    let error = start("b", &config, &nothing).unwrap_err();
    assert!(matches!(error, Error::NoSamples { .. }), "{error}");
    config.validation_share = 0.0;
    let (events, summary) = events(&mut start("c", &config, &train).unwrap());
    assert_eq!(summary.best_validation, None);
    let validated = |e: &TrainEvent| matches!(e, TrainEvent::Validated { .. });
    assert!(!events.iter().any(validated));
}

/// A step of two batches reports the mean of both, and its panel has the name of its sample.
#[test]
fn a_step_of_several_batches_reports_all_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, train, validation) = small(&drive(&folder.path().join("street"), 14), 1);
    config.accumulate = 2;
    let sets = (train.clone(), validation);
    let mut trainer = started(folder.path(), config, sets).unwrap();
    let config = trainer.config().clone();

    let device = Device::flex().autodiff();
    let model = Model::new(&config, &device).unwrap();
    let loader = BatchLoader::training(&config, train, 0);
    let batches = [0, 1].map(|_| loader.next(&device).unwrap().unwrap());
    let schedule = Schedule {
        speed_weight: losses::speed_weight(config.loss.speed, 0, 1, 1, 1),
        masks_active: false,
    };
    let terms = batches.each_ref().map(|batch| {
        let pass = model.forward(batch);
        model.loss(&pass, batch, schedule).terms
    });
    assert_ne!(batches[0].names[0], batches[1].names[0]);
    assert!((terms[0].total - terms[1].total).abs() > 1e-3, "{terms:?}");

    let (events, _) = events(&mut trainer);
    let step = events.iter().find_map(|e| match e {
        TrainEvent::Step { losses, .. } => Some(*losses),
        _ => None,
    });
    let named = step.unwrap().named();
    for (i, (name, value)) in named.into_iter().enumerate() {
        let mean = (terms[0].named()[i].1 + terms[1].named()[i].1) / 2.0;
        assert!(
            (value - mean).abs() < 1e-6,
            "{name}: {value} instead of {mean}"
        );
    }
    let panel = events.iter().find_map(|e| match e {
        TrainEvent::Panel { panel, .. } => Some(panel),
        _ => None,
    });
    let panel = panel.unwrap();
    let shown = batches[1].clean[0].clone().narrow(0, 0, 1).into_data();
    assert_eq!(panel.image, shown.iter::<f32>().collect::<Vec<_>>());
    assert_eq!(panel.name, batches[1].names[0]);
}

/// If the vehicle gives the motion, PoseNet's own loss does not depend on depth, but it would dominate the choice.
#[test]
fn best_is_chosen_by_terms_that_depth_can_change() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 14);
    for motion in [ViewMotion::Auto, ViewMotion::PoseNet] {
        let (mut config, train, validation) = small(&drive, 8);
        config.view_motion = motion;
        config.loss.speed = 30.0;
        let at = folder.path().join(format!("{motion:?}"));
        std::fs::create_dir(&at).unwrap();
        let mut trainer = started(&at, config, (train, validation)).unwrap();
        let (events, summary) = events(&mut trainer);
        let mut lowest = f64::INFINITY;
        let mut validations = 0;
        for event in events {
            let TrainEvent::Validated {
                losses,
                selection,
                best,
                ..
            } = event
            else {
                continue;
            };
            let of_depth = match motion {
                ViewMotion::PoseNet => losses.reprojection + 30.0 * losses.speed,
                _ => losses.reprojection,
            };
            assert_eq!(selection, of_depth);
            assert!(losses.total > of_depth, "the total has smoothness at least");
            assert_eq!(best, selection < lowest, "{motion:?}");
            lowest = lowest.min(selection);
            validations += 1;
        }
        assert_eq!(validations, 4);
        assert_eq!(summary.best_validation, Some(lowest));
    }
}

#[test]
fn frozen_weights_stay_and_the_others_learn() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, train, validation) = small(&drive(&folder.path().join("street"), 8), 2);
    config.freeze = vec!["depth.encoder".into(), "depth.decoder.heads".into()];
    // Weight decay would change them, too.
    config.weight_decay = 0.1;
    let sets = || (train.clone(), validation.clone());
    let mut trainer = started(folder.path(), config.clone(), sets()).unwrap();
    let learned = |model: &Model| collect(&model.depth_net).tensors;
    let before = learned(trainer.model());
    trainer.run(&mut |_| Control::Continue).unwrap();
    let mut kept = 0;
    let stays = |before: &Tensors, after: &Tensors, kept: &mut usize| {
        for (name, tensor) in before {
            // Running statistics follow the batches, whether weights are frozen or not.
            if name.contains("running") {
                continue;
            }
            let frozen = name.starts_with("encoder") || name.starts_with("decoder.heads");
            assert_eq!(after[name].values == tensor.values, frozen, "{name}");
            *kept += usize::from(frozen);
        }
    };
    let after = learned(trainer.model());
    stays(&before, &after, &mut kept);
    assert!(kept > 40, "{kept}");

    // They also stay frozen in a resumed run.
    config.steps = Some(3);
    let run = RunFolder::open(trainer.folder()).unwrap().0;
    let mut resumed = Trainer::resume(config.clone(), run, sets(), &Device::flex()).unwrap();
    resumed.run(&mut |_| Control::Continue).unwrap();
    stays(&after, &learned(resumed.model()), &mut kept);

    for (number, (names, part)) in [
        (vec!["depth.encode"], "found depth.encode"),
        (vec!["depth", "pose"], "weights left to learn"),
    ]
    .into_iter()
    .enumerate()
    {
        config.freeze = names.into_iter().map(String::from).collect();
        let at = folder.path().join(number.to_string());
        std::fs::create_dir(&at).unwrap();
        let error = started(&at, config.clone(), sets()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("`freeze`") && text.contains(part), "{text}");
    }
}
