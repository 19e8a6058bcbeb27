//! Learning from known depth: of simulated views, of recordings, and together with video.

use crate::support::drive;
use burn::tensor::{Device, Tensor};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_hint::Hint;
use deepfusion_nn::ops::{Precision, supports};
use deepfusion_nn::{InputSize, weights};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{
    Control, DataSetConfig, DepthBatch, DepthLoader, Error, Learn, LossTerms, Preset, RunFolder,
    SampleSet, SimulatedConfig, Supervision, TrainConfig, TrainEvent, Trainer, validation_loss,
};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A small network that learns from simulated views.
fn streets(steps: usize) -> TrainConfig {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (96, 64);
    config.batch = 2;
    config.steps = Some(steps);
    config.validate_every = steps;
    config.learning_rate_warmup_steps = 0;
    config.canonical_focal_px = Some(60.0);
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(8);
    config.depth_net.decoder.widths = [16, 16, 8, 8, 8];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    config.data.sets = vec![DataSetConfig {
        name: "streets".into(),
        learn: Learn::Depth,
        simulated: Some(SimulatedConfig {
            seed: 3,
            views: 40,
            validation_views: 6,
            views_per_world: 8,
            plain: 0.25,
            ..SimulatedConfig::default()
        }),
        ..DataSetConfig::default()
    }];
    config
}

/// Adds recordings as a data set, beside the simulated views if there are any.
fn with_recording(config: &mut TrainConfig, paths: Vec<PathBuf>, learn: Learn) {
    config.data.sets.push(DataSetConfig {
        name: "drive".into(),
        paths,
        learn,
        ..DataSetConfig::default()
    });
}

fn samples(config: &TrainConfig) -> Result<(SampleSet, SampleSet), Error> {
    config.validate()?;
    let mut recordings = Vec::new();
    for (set, of) in config.data.sets.iter().enumerate() {
        for path in &of.paths {
            let opened = Dataset::open(path, &OpenOptions::default())?;
            recordings.extend(opened.into_iter().map(|d| (set, d)));
        }
    }
    let (train, validation, skipped) = SampleSet::split_sets(config, recordings, None)?;
    assert!(skipped.is_empty(), "{skipped:?}");
    Ok((train, validation))
}

fn trainer(config: &TrainConfig, at: &Path) -> Trainer {
    let sets = samples(config).unwrap();
    let folder = RunFolder::create(at).unwrap();
    Trainer::create(config.clone(), folder, sets, &Device::flex(), Ok).unwrap()
}

/// The losses of the steps, and the last panel's supervision.
fn run(trainer: &mut Trainer, until: Option<usize>) -> (Vec<LossTerms>, Option<Supervision>) {
    let (mut steps, mut supervision) = (Vec::new(), None);
    let mut listen = |event| {
        match event {
            TrainEvent::Step { losses, step, .. } => {
                steps.push(losses);
                if Some(step) == until {
                    return Control::Stop;
                }
            }
            TrainEvent::Panel { panel, .. } => supervision = Some(panel.supervision),
            TrainEvent::Warning { warning, .. } => panic!("{warning}"),
            _ => {}
        }
        Control::Continue
    };
    trainer.run(&mut listen).unwrap();
    (steps, supervision)
}

/// The held-out error falls by more than a tenth within forty steps, and a resumed run equals an uninterrupted one.
#[test]
fn simulated_views_teach_depth_and_resume_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let config = streets(40);
    let mut whole = trainer(&config, &folder.path().join("whole"));
    let (_, validation) = samples(&config).unwrap();
    let held_out = |trainer: &Trainer| {
        let device = Device::flex().autodiff();
        let (model, config) = (trainer.model(), trainer.config());
        validation_loss(model, config, &validation, &device).unwrap()
    };
    let (before, _) = held_out(&whole);
    let (steps, supervision) = run(&mut whole, None);
    let (after, scale_ratio) = held_out(&whole);
    assert!(
        after.depth < 0.9 * before.depth,
        "{} to {}",
        before.depth,
        after.depth
    );
    // After forty steps a tiny network's depth is not metric yet, but a confusion of metres and millimetres would show.
    assert!((0.1..10.0).contains(&scale_ratio), "{scale_ratio}");
    assert!(
        steps
            .iter()
            .all(|l| l.reprojection == 0.0 && l.depth == l.total)
    );
    let Some(Supervision::Depth { truth, error }) = supervision else {
        panic!("{supervision:?}");
    };
    assert!(truth.iter().any(|d| *d > 0.0) && error.iter().any(|e| *e != 0.0));
    let camera = RunFolder::open(whole.folder())
        .unwrap()
        .0
        .read_findings()
        .unwrap()
        .camera
        .unwrap();
    assert_eq!((camera.width, camera.height), (96, 64));

    let parts = folder.path().join("parts");
    let (mut begun, _) = run(&mut trainer(&config, &parts), Some(7));
    let (run_folder, _) = RunFolder::open(&parts).unwrap();
    let stored = run_folder.read_config().unwrap();
    let sets = samples(&stored).unwrap();
    let mut resumed = Trainer::resume(stored, run_folder, sets, &Device::flex()).unwrap();
    begun.extend(run(&mut resumed, Some(12)).0);
    assert_eq!(begun, steps[..12]);
}

/// Every other batch has one of the other sizes, in turn. A run that is stopped before such a batch and resumed equals an uninterrupted
/// one.
#[test]
fn batches_take_the_other_sizes_in_turn() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streets(6);
    let others = [[64, 96], [128, 64]].map(|[width, height]| InputSize { width, height });
    config.augmentation.sizes = others.to_vec();
    let (train, _) = samples(&config).unwrap();
    let loader = DepthLoader::training(&config, train.depth, 0);
    for [height, width] in [[64, 96], [96, 64], [64, 96], [64, 128], [64, 96]] {
        let batch = loader.next(&Device::flex()).unwrap().unwrap();
        assert_eq!(batch.network.dims(), [2, 3, height, width]);
        assert_eq!(batch.truth.known.dims(), [2, 1, height, width]);
    }

    let (steps, _) = run(&mut trainer(&config, &folder.path().join("whole")), None);
    assert!(steps.iter().all(|loss| loss.total.is_finite()));
    let parts = folder.path().join("parts");
    let (mut begun, _) = run(&mut trainer(&config, &parts), Some(1));
    let (run_folder, _) = RunFolder::open(&parts).unwrap();
    let stored = run_folder.read_config().unwrap();
    let sets = samples(&stored).unwrap();
    let mut resumed = Trainer::resume(stored, run_folder, sets, &Device::flex()).unwrap();
    begun.extend(run(&mut resumed, None).0);
    assert_eq!(begun, steps);

    config.augmentation.sizes[0].width = 100;
    assert!(config.validate().is_err());
}

/// The uncertainty head learns while depth stays the same, to the last bit.
#[test]
fn the_uncertainty_head_learns_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streets(20);
    config.depth_net.uncertainty = true;
    config.loss.depth.weight = 0.0;
    (config.learning_rate, config.weight_decay) = (1e-2, 0.1);
    let mut trainer = trainer(&config, &folder.path().join("run"));
    let (_, validation) = samples(&config).unwrap();
    let held_out = |trainer: &Trainer| {
        let device = Device::flex().autodiff();
        let (model, config) = (trainer.model(), trainer.config());
        let (terms, _) = validation_loss(model, config, &validation, &device).unwrap();
        (terms, weights::collect(&model.depth_net).tensors)
    };
    let (before, old) = held_out(&trainer);
    run(&mut trainer, None);
    let (after, new) = held_out(&trainer);
    assert_eq!(after.depth, before.depth);
    assert!(
        after.uncertainty < before.uncertainty - 0.05,
        "{} to {}",
        before.uncertainty,
        after.uncertainty
    );
    for (name, tensor) in &old {
        let same = *tensor == new[name];
        assert_eq!(same, !name.starts_with("uncertainty."), "{name}");
    }
    // Without known depth the head could not learn.
    let mut video = Preset::Tiny.config();
    video.depth_net.uncertainty = true;
    let error = video.validate().unwrap_err();
    assert!(
        error.to_string().contains("depth_net.uncertainty"),
        "{error}"
    );
}

fn batches(config: &TrainConfig, set: &SampleSet) -> Vec<DepthBatch> {
    let loader = DepthLoader::validation(config, set.depth.clone());
    let next = || loader.next(&Device::flex());
    std::iter::from_fn(next).map(Result::unwrap).collect()
}

/// A drive's scans, its motion or both are learned from, as `learn` of its set requires.
#[test]
fn a_drive_teaches_what_its_set_requires() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = Simulation::new(&SimConfig {
        seed: 5,
        frames: 8,
        scan_every: 2,
        ..SimConfig::default()
    });
    let scanned = folder.path().join("scanned");
    let scanned = write_kitti(&simulation.unwrap(), &scanned, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    for (learn, motion, depth) in [
        (Learn::OwnMotion, true, false),
        (Learn::Depth, false, true),
        (Learn::Both, true, true),
    ] {
        let mut config = streets(1);
        config.data.sets.clear();
        with_recording(&mut config, vec![scanned.clone()], learn);
        let (train, validation) = samples(&config).unwrap();
        assert_eq!(train.samples.is_empty(), !motion, "{learn:?}");
        assert_eq!(train.depth.is_empty(), !depth, "{learn:?}");
        assert!(!validation.is_empty());
        if !depth {
            continue;
        }
        // Exact depth of eight frames, the last one held out. If samples of video are held out, too, so is the depth of their frames.
        let held: Vec<usize> = validation
            .samples
            .iter()
            .flat_map(|sample| {
                sample
                    .sources()
                    .map(|(_, frame)| frame)
                    .chain([sample.snippet.target])
            })
            .collect();
        let known: Vec<usize> = train.depth.frames.iter().map(|known| known.frame).collect();
        assert_eq!(held.is_empty(), !motion);
        assert!(
            known.iter().all(|frame| !held.contains(frame)),
            "{known:?} {held:?}"
        );
        assert_eq!(
            (known.len(), validation.depth.len()),
            (if motion { 6 } else { 7 }, 1)
        );
        for batch in batches(&config, &train) {
            let share = |mask: &Tensor<4>| mask.clone().mean().into_scalar::<f32>();
            let (known, far) = (share(&batch.truth.known), share(&batch.truth.far));
            assert!(
                known > 0.5 && far > 0.02,
                "a street and its sky: {known}, {far}"
            );
            assert!(known + far > 0.99, "every pixel: {known}, {far}");
        }
        let at = folder.path().join(format!("{learn:?}"));
        let (steps, _) = run(&mut trainer(&config, &at), None);
        assert!(steps[0].depth > 0.0);
        assert_eq!(steps[0].reprojection > 0.0, motion);
    }
    // A drive to validate on must be another one, whatever is learned from it.
    for learn in [Learn::Depth, Learn::Both] {
        let mut config = streets(1);
        config.data.sets.clear();
        with_recording(&mut config, vec![scanned.clone()], learn);
        let open = || Dataset::open(&scanned, &OpenOptions::default()).unwrap();
        let error = SampleSet::split(&config, open(), Some(open())).unwrap_err();
        assert!(
            matches!(error, Error::SharedFrames { .. }),
            "{learn:?}: {error}"
        );
    }
    // A real drive has only scans.
    std::fs::remove_dir_all(scanned.join("proj_depth")).unwrap();
    let mut config = streets(1);
    config.data.sets.clear();
    with_recording(&mut config, vec![scanned.clone()], Learn::Depth);
    let (train, validation) = samples(&config).unwrap();
    assert_eq!((train.depth.len(), validation.depth.len()), (3, 1));
    for batch in batches(&config, &train) {
        let known = batch.truth.known.clone().mean().into_scalar::<f32>();
        assert!(known > 0.02 && known < 0.9, "a scan: {known}");
        let far = batch.truth.far.clone().sum().into_scalar::<f32>();
        assert!(far < 0.05 * 96.0 * 64.0 * batch.len() as f32, "no sky");
    }
    // Without exact depth or scans there is nothing to learn from: an error before the run begins.
    std::fs::remove_dir_all(scanned.join("velodyne_points")).unwrap();
    let mut config = streets(1);
    config.data.sets.clear();
    with_recording(&mut config, vec![scanned], Learn::Depth);
    let error = samples(&config).unwrap_err();
    assert!(matches!(error, Error::NoDepth { .. }), "{error}");
    assert!(error.hint().unwrap().contains("learn = \"self\""));
}

/// Simulated depth and the motion of a drive in one step: both losses have gradients, and each is logged. Stopped after the first step and
/// resumed, the run ends with the same weights, to the last bit.
#[test]
fn depth_and_motion_are_learned_in_one_step_and_resume_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streets(3);
    config.depth_batch = 1;
    let drive = drive(&folder.path().join("street"), 8);
    with_recording(&mut config, vec![drive], Learn::OwnMotion);
    let mut whole = trainer(&config, &folder.path().join("whole"));
    let (steps, _) = run(&mut whole, None);
    assert_eq!(steps.len(), 3);
    for losses in &steps {
        assert!(losses.depth > 0.0 && losses.reprojection > 0.0 && losses.speed > 0.0);
        assert!(losses.total > losses.depth);
    }

    let parts = folder.path().join("parts");
    let (mut begun, _) = run(&mut trainer(&config, &parts), Some(1));
    let (run_folder, _) = RunFolder::open(&parts).unwrap();
    let stored = run_folder.read_config().unwrap();
    let sets = samples(&stored).unwrap();
    let mut resumed = Trainer::resume(stored, run_folder, sets, &Device::flex()).unwrap();
    begun.extend(run(&mut resumed, None).0);
    assert_eq!(begun, steps);
    let learned = |trainer: &Trainer| {
        let model = trainer.model();
        let networks = [
            weights::collect(&model.depth_net),
            weights::collect(model.pose_net.as_ref().unwrap()),
        ];
        networks.map(|network| network.tensors)
    };
    assert!(learned(&resumed) == learned(&whole));
}

/// Frozen weights must leave something to learn from each kind of sample in a run.
#[test]
fn frozen_weights_must_leave_some_for_every_kind_of_sample() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 8);
    let mixed = |config: &mut TrainConfig| {
        config.depth_batch = 1;
        with_recording(config, vec![drive.clone()], Learn::OwnMotion);
    };
    let uncertainty = |config: &mut TrainConfig| {
        config.depth_net.uncertainty = true;
        config.loss.depth.weight = 0.0;
    };
    let video = |config: &mut TrainConfig| {
        config.data.sets.clear();
        with_recording(config, vec![drive.clone()], Learn::OwnMotion);
    };
    type Change<'a> = &'a dyn Fn(&mut TrainConfig);
    let cases: [(&str, &[&str], Change, Option<&str>); 8] = [
        ("depth alone", &["depth"], &|_| {}, Some("known depth")),
        ("its encoder", &["depth.encoder"], &|_| {}, None),
        ("both", &["depth"], &mixed, Some("known depth")),
        ("both, a part", &["depth.decoder", "pose"], &mixed, None),
        (
            "the head",
            &["depth.uncertainty"],
            &uncertainty,
            Some("known depth"),
        ),
        (
            "all but the head",
            &["depth.encoder", "depth.decoder"],
            &uncertainty,
            None,
        ),
        ("video", &["depth", "pose"], &video, Some("from video")),
        ("PoseNet alone", &["depth"], &video, None),
    ];
    for (name, freeze, change, refused) in cases {
        let mut config = streets(1);
        change(&mut config);
        config.freeze = freeze.iter().map(|&part| part.into()).collect();
        let run_folder = RunFolder::create(&folder.path().join(name)).unwrap();
        let sets = samples(&config).unwrap();
        let created = Trainer::create(config, run_folder, sets, &Device::flex(), Ok);
        match refused {
            None => {
                run(&mut created.unwrap(), None);
            }
            Some(part) => {
                let text = created.unwrap_err().to_string();
                assert!(
                    text.contains("`freeze`") && text.contains(part),
                    "{name}: {text}"
                );
            }
        }
    }
}

/// What looks the same through a lens of twice the focal length is twice as far away: the true depth divided by the depth that the
/// network's output stands for is the same.
#[test]
fn twice_the_focal_length_means_twice_the_depth() {
    let config = streets(1);
    let (train, _) = samples(&config).unwrap();
    let seen = batches(&config, &train);
    let range = config.depth_net.range;
    for batch in seen.iter().take(3) {
        let span: Vec<f32> = batch.factors.span.clone().into_data().iter().collect();
        let spans = 1.0 / range.min_m - 1.0 / range.max_m;
        for (i, (span, view)) in span.iter().zip(&batch.names).enumerate() {
            let number = view.rsplit('/').next().unwrap().parse().unwrap();
            let view = train.depth.simulated[0].endless.view(number);
            let focal = view.intrinsics.fy / 60.0;
            assert!((f64::from(*span) * focal - spans).abs() < 1e-4 * spans);
            // The sigmoid's depth is canonical: depth × f_c/f_y.
            let known: Vec<f32> = batch.truth.known.clone().into_data().iter().collect();
            let logs: Vec<f32> = batch.truth.log_depth.clone().into_data().iter().collect();
            let at = i * 96 * 64;
            let pixel = (0..96 * 64).find(|p| known[at + p] > 0.0).unwrap();
            let depth = view.depth.data[pixel];
            assert!((logs[at + pixel] - depth.ln()).abs() < 1e-5);
        }
    }
}

#[test]
fn invalid_sets_are_refused_by_field() {
    type Change = fn(&mut TrainConfig);
    let cases: [(&str, Change); 8] = [
        ("data.sets.learn", |c| c.data.sets[0].learn = Learn::Both),
        ("data.sets.paths", |c| c.data.sets[0].paths.push("x".into())),
        ("data.sets.simulated.views", |c| {
            c.data.sets[0].simulated.as_mut().unwrap().views = 0;
        }),
        ("data.sets.simulated.plain", |c| {
            c.data.sets[0].simulated.as_mut().unwrap().plain = 2.0;
        }),
        ("canonical_focal_px", |c| c.canonical_focal_px = Some(0.0)),
        ("augmentation.zoom", |c| c.augmentation.zoom = 0.5),
        ("augmentation.zoom", |c| c.augmentation.zoom = f32::NAN),
        ("loss.depth.gradient", |c| c.loss.depth.gradient = f64::NAN),
    ];
    for (field, change) in cases {
        let mut config = streets(1);
        change(&mut config);
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains(&format!("`{field}`")), "{error}");
    }
}

/// With bf16 convolutions a run learns as in f32: from the same views, with nearly the same losses. On a processor without bf16 it is
/// refused.
#[test]
fn convolutions_in_bf16_learn_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streets(12);
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(16);
    config.depth_net.decoder.widths = [16; 5];
    let (exact, _) = run(&mut trainer(&config, &folder.path().join("f32")), None);
    config.precision = Precision::Bf16;
    let at = folder.path().join("bf16");
    if !supports(&Device::flex(), Precision::Bf16) {
        let sets = samples(&config).unwrap();
        let run = RunFolder::create(&at).unwrap();
        let error = Trainer::create(config, run, sets, &Device::flex(), Ok).unwrap_err();
        assert!(error.to_string().contains("`precision`"), "{error}");
        return;
    }
    let (pairs, _) = run(&mut trainer(&config, &at), None);
    assert_eq!(pairs.len(), exact.len());
    for (step, (a, b)) in pairs.iter().zip(&exact).enumerate() {
        let (a, b) = (a.depth, b.depth);
        assert!((a - b).abs() < 0.02 * b, "step {step}: {a} instead of {b}");
    }
    assert_ne!(pairs[0].depth, exact[0].depth, "bf16 was used");
    let stored = std::fs::read_to_string(at.join("config.toml")).unwrap();
    assert!(stored.contains("precision = \"bf16\""));
}
