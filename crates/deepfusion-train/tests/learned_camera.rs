//! The focal length of an unknown camera, learned with the networks and compared with the simulator's.

use std::path::Path;

use crate::support::{folder_without_camera, small_without_data};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{Dataset, OpenOptions, to_chw};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_hint::Hint;
use deepfusion_nn::ops::{self, Precision, supports};
use deepfusion_sim::{SimConfig, Simulation};
use deepfusion_train::{
    Adam, AssumedCamera, CheckpointKind, Control, Error, LearnedCamera, LossTerms, Model, Motion,
    NamedGradients, RunFolder, SampleSet, SnippetBatch, StepOutcome, StoredNetwork, TrainConfig,
    TrainEvent, TrainWarning, Trainer, ViewMotion, synthesise,
};
use nalgebra::Vector3;

/// Five frames per second, so that the bends turn the view by some pixels per frame.
fn simulated(seed: u64, frames: usize) -> Simulation {
    Simulation::new(&SimConfig {
        seed,
        frames,
        width: 320,
        height: 96,
        fps: 5.0,
        scan_every: 0,
        ..SimConfig::default()
    })
    .unwrap()
}

/// A road with bends to both sides: 1.5 degrees per frame.
fn bends(frames: usize) -> Simulation {
    simulated(3, frames)
}

/// A straight road: 0.02 degrees per frame.
fn straight(frames: usize) -> Simulation {
    simulated(5, frames)
}

fn config(steps: usize) -> TrainConfig {
    let mut config = small_without_data(steps);
    config.batch = 4;
    config.view_motion = ViewMotion::Vehicle;
    config.learning_rate_warmup_steps = 10;
    // The simulator's camera has a field of view of 81 degrees.
    config.assumed_camera = Some(AssumedCamera {
        hfov_deg: 66.0,
        learning_rate: 0.01,
        ..AssumedCamera::default()
    });
    config
}

/// With a unit of translation, for a network without data to take it from.
fn with_unit(mut config: TrainConfig) -> TrainConfig {
    config.pose_net.metres_per_unit = 1.0;
    config
}

fn samples(config: &TrainConfig, drives: &[&Path]) -> (SampleSet, SampleSet) {
    let options = OpenOptions {
        assumed_camera: config.assumed_camera.map(|camera| camera.intrinsics()),
        ..OpenOptions::default()
    };
    let open = |drive: &&Path| Dataset::open(drive, &options).unwrap();
    let datasets = drives.iter().flat_map(open).collect();
    let (train, validation, _) = SampleSet::split(config, datasets, None).unwrap();
    (train, validation)
}

fn matrices(of: &nalgebra::Matrix3<f64>, n: usize, device: &Device) -> Tensor<3> {
    let values: Vec<f32> = (0..9).map(|i| of[(i / 3, i % 3)] as f32).collect();
    Tensor::<3>::from_data(TensorData::new(values, [1, 3, 3]), device).repeat_dim(0, n)
}

fn motions(all: &[Se3], device: &Device) -> Motion {
    let rotation = all.iter().map(|m| matrices(&m.rotation(), 1, device));
    let translation = all.iter().map(|m| {
        let t = m.translation();
        Tensor::<2>::from_data([[t.x as f32, t.y as f32, t.z as f32]], device)
    });
    Motion {
        rotation: Tensor::cat(rotation.collect(), 0),
        translation: Tensor::cat(translation.collect(), 0),
    }
}

/// Pairs of frames with a camera, without images for networks.
fn pairs(k: &Intrinsics, source_from_target: &[Se3], device: &Device) -> SnippetBatch {
    let n = source_from_target.len();
    SnippetBatch {
        clean: Vec::new(),
        network: Vec::new(),
        intrinsics: matrices(&k.matrix(), n, device),
        inverse_intrinsics: matrices(&k.inverse_matrix(), n, device),
        distance_m: Vec::new(),
        distance_weight: Vec::new(),
        measured: vec![motions(source_from_target, device)],
        turns_known: None,
        other_camera: None,
        offsets: vec![1],
        names: vec![String::new(); n],
        factors: None,
    }
}

/// A weighted sum of the coordinates where pixels land, point by point in f64 by the definition: p' = K·(R·D·K⁻¹·p̃ + t).
fn landing(k: &Intrinsics, source_from_target: &Se3, depths: &[f64], weights: &[f64]) -> f64 {
    let width = k.width as usize;
    let of = |(i, depth): (usize, &f64)| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let ray = Vector3::new((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1.0);
        let there = source_from_target.transform(&(ray * *depth));
        let u = k.fx * there.x / there.z + k.cx;
        let v = k.fy * there.y / there.z + k.cy;
        u * weights[2 * i] + v * weights[2 * i + 1]
    };
    depths.iter().enumerate().map(of).sum()
}

/// Where the pixels of a small image land, and how that changes with fx, with fy, and with the learned number, which changes both. The
/// reference is f64. f32 has 7 digits; the sums have 96 terms of some ten pixels.
#[test]
fn gradients_of_the_focal_lengths_equal_those_of_the_definition() {
    let device = Device::flex().autodiff();
    let (width, height) = (12, 8);
    let k = Intrinsics {
        fx: 9.0,
        fy: 10.5,
        cx: 5.1,
        cy: 3.8,
        width,
        height,
    };
    let motion = Se3::from_axis_angle(
        Vector3::new(0.03, -0.12, 0.02),
        Vector3::new(0.3, -0.1, -0.8),
    );
    let count = (width * height) as usize;
    let depths: Vec<f64> = (0..count).map(|i| 4.0 + (i as f64).sin()).collect();
    let weights: Vec<f64> = (0..2 * count)
        .map(|i| 10.0 * (0.13 * i as f64).cos())
        .collect();
    let reference = |k: &Intrinsics| landing(k, &motion, &depths, &weights);
    let slope = |change: &dyn Fn(&mut Intrinsics, f64)| {
        let at = |step: f64| {
            let mut moved = k;
            change(&mut moved, step);
            reference(&moved)
        };
        (at(1e-5) - at(-1e-5)) / 2e-5
    };
    let by_fx = slope(&|k, step| k.fx += step);
    let by_fy = slope(&|k, step| k.fy += step);
    assert!(by_fx.abs() > 0.1 && by_fy.abs() > 0.1, "{by_fx} {by_fy}");

    let inverse: Vec<f32> = depths.iter().map(|d| d.recip() as f32).collect();
    let shape = [1, 1, height as usize, width as usize];
    let inverse = Tensor::<4>::from_data(TensorData::new(inverse, shape), &device);
    // In the order of the coordinates: all u, then all v.
    let of_axis = |axis: usize| weights.iter().skip(axis).step_by(2);
    let planes: Vec<f32> = of_axis(0).chain(of_axis(1)).map(|w| *w as f32).collect();
    let shape = [1, 2, height as usize, width as usize];
    let planes = Tensor::<4>::from_data(TensorData::new(planes, shape), &device);
    let landed = |k: &Tensor<3>, inverse_k: &Tensor<3>| {
        let motion = motions(&[motion], &device);
        let image = Tensor::zeros([1, 3, height as usize, width as usize], &device);
        let view = synthesise(image, inverse.clone(), &motion, k, inverse_k);
        view.coords.mul(planes.clone()).sum()
    };
    let close = |found: f64, expected: f64, what: &str| {
        let apart = (found - expected).abs();
        assert!(
            apart < 2e-4 * (1.0 + expected.abs()),
            "{what}: {found} instead of {expected}"
        );
    };
    let number = |t: Tensor<1>| f64::from(t.into_scalar::<f32>());

    let leaf = |v: f64| Tensor::<1>::from_data([v as f32], &device).require_grad();
    let (fx, fy) = (leaf(k.fx), leaf(k.fy));
    let one = |v: f64| Tensor::<1>::from_data([v as f32], &device);
    let rows = |a: Tensor<1>, b: Tensor<1>, c: [Tensor<1>; 2]| {
        let [cx, cy] = c;
        let zero = || one(0.0);
        let all = vec![a, zero(), cx, zero(), b, cy, zero(), zero(), one(1.0)];
        Tensor::cat(all, 0).reshape([1, 3, 3])
    };
    let matrix = rows(fx.clone(), fy.clone(), [one(k.cx), one(k.cy)]);
    let (ix, iy) = (fx.clone().recip(), fy.clone().recip());
    let middle = [ix.clone().mul_scalar(-k.cx), iy.clone().mul_scalar(-k.cy)];
    let sum = landed(&matrix, &rows(ix, iy, middle));
    close(number(sum.clone()), reference(&k), "value");
    let gradients = sum.backward();
    close(number(fx.grad(&gradients).unwrap()), by_fx, "fx");
    close(number(fy.grad(&gradients).unwrap()), by_fy, "fy");

    // The learned camera, here with a focal length 20 % above the assumed one: its value and its gradient.
    let assumed = Intrinsics {
        fx: k.fx / 1.2,
        fy: k.fy / 1.2,
        ..k
    };
    let mut model = Model::new(&with_unit(config(1)), &device).unwrap();
    let ratio = leaf(1.2_f64.ln());
    let focal = model.focal.as_mut().unwrap();
    focal.log_ratio = focal.log_ratio.clone().map(|_| ratio.clone());
    assert!((focal.ratio() - 1.2).abs() < 1e-6);
    let seen = model.with_learned_camera(pairs(&assumed, &[motion], &device));
    let sum = landed(&seen.intrinsics, &seen.inverse_intrinsics);
    close(
        number(sum.clone()),
        reference(&k),
        "the learned camera's value",
    );
    let gradient = number(ratio.grad(&sum.backward()).unwrap());
    close(gradient, k.fx * by_fx + k.fy * by_fy, "ln f");
}

/// With the true depth and motion in bends, the photometric error alone corrects a focal length that is 30 % off.
#[test]
fn the_photometric_error_in_bends_finds_the_focal_length() {
    let device = Device::flex().autodiff();
    let simulation = bends(25);
    let truth = simulation.intrinsics();
    let (h, w) = (truth.height as usize, truth.width as usize);
    let frames = [2, 9, 16, 23].map(|i| (simulation.frame(i), simulation.frame(i + 1)));
    let images = |pick: &dyn Fn(usize) -> Vec<f32>, channels: usize| {
        let all: Vec<f32> = (0..frames.len()).flat_map(pick).collect();
        let shape = [frames.len(), channels, h, w];
        Tensor::<4>::from_data(TensorData::new(all, shape), &device)
    };
    let targets = images(&|i| to_chw(&frames[i].0.rgb), 3);
    let sources = images(&|i| to_chw(&frames[i].1.rgb), 3);
    let inverse = |d: &f32| if *d > 0.0 { 1.0 / *d } else { 1e-6 };
    let depths = images(&|i| frames[i].0.depth.data.iter().map(inverse).collect(), 1);
    let motions = frames
        .each_ref()
        .map(|(a, b)| b.world_from_cam.inverse() * a.world_from_cam);
    let assumed = Intrinsics {
        fx: truth.fx * 1.3,
        fy: truth.fy * 1.3,
        ..truth
    };
    let batch = pairs(&assumed, &motions, &device);
    let mut model = Model::new(&with_unit(config(1)), &device).unwrap();
    let mut adam = Adam::default();
    for _ in 0..60 {
        let seen = model.with_learned_camera(batch.clone());
        let view = synthesise(
            sources.clone(),
            depths.clone(),
            &seen.measured[0],
            &seen.intrinsics,
            &seen.inverse_intrinsics,
        );
        let error = ops::photometric_error(view.image, targets.clone(), 0.85);
        let loss = error.mul(view.valid.float()).mean();
        let focal = model.focal.take().unwrap();
        let mut gradients = NamedGradients::default();
        gradients.add("focal", &focal, &mut loss.backward(), 1.0);
        let (outcome, step) = adam.begin(&gradients, 0.01, 0.0, 0.0);
        assert!(matches!(outcome, StepOutcome::Done { .. }));
        model.focal = Some(adam.apply(&step.unwrap(), "focal", focal, &gradients));
    }
    let found = 1.3 * model.focal.unwrap().ratio();
    assert!((found - 1.0).abs() < 0.02, "{found} of the true one");
}

/// The events of a run: its losses, the course of the focal length, and its camera at the end.
#[derive(Debug, PartialEq)]
struct Outcome {
    losses: Vec<(usize, LossTerms)>,
    camera: Option<LearnedCamera>,
    warnings: Vec<TrainWarning>,
}

fn run(trainer: &mut Trainer, stop: Option<usize>) -> Outcome {
    let mut outcome = Outcome {
        losses: Vec::new(),
        camera: None,
        warnings: Vec::new(),
    };
    trainer
        .run(&mut |event| {
            match event {
                TrainEvent::Step { step, losses, .. } => {
                    outcome.losses.push((step, losses));
                    if stop == Some(step) {
                        return Control::Stop;
                    }
                }
                TrainEvent::Validated { step, losses, .. } => outcome.losses.push((step, losses)),
                TrainEvent::Camera { learned, .. } => outcome.camera = Some(learned),
                TrainEvent::Warning { warning, .. } => outcome.warnings.push(warning),
                _ => {}
            }
            Control::Continue
        })
        .unwrap();
    outcome
}

fn start(config: &TrainConfig, run: &Path, sets: (SampleSet, SampleSet)) -> Trainer {
    let folder = RunFolder::create(run).unwrap();
    Trainer::create(config.clone(), folder, sets, &Device::flex(), Ok).unwrap()
}

/// New networks and a camera that is off by a third. After a few steps depth is still poor, but measured turns have corrected the focal
/// length, and the spread confirms it.
#[test]
fn a_short_run_on_bends_finds_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let simulation = bends(40);
    folder_without_camera(&simulation, &at("drive"));
    let mut config = config(60);
    config.validate_every = 60;
    let sets = samples(&config, &[&at("drive")]);
    let assumed = sets.0.camera().unwrap();
    let truth = simulation.intrinsics();
    let off = assumed.fx / truth.fx;
    assert!((off - 1.32).abs() < 0.02, "{off}");
    let mut trainer = start(&config, &at("run"), sets);
    let outcome = run(&mut trainer, None);
    let learned = outcome.camera.unwrap();
    let [fx, fy] = learned.focal_px;
    assert!((fx / truth.fx - 1.0).abs() < 0.04, "{learned:?} {truth:?}");
    assert!((fx / fy - 1.0).abs() < 1e-6, "square pixels");
    assert!(learned.is_reliable(), "{learned:?}");
    assert!(outcome.warnings.is_empty(), "{:?}", outcome.warnings);

    // The run's camera is the learned one.
    let (run, _) = RunFolder::open(&at("run")).unwrap();
    let findings = run.read_findings().unwrap();
    assert_eq!(findings.learned_camera, Some(learned));
    let stored = StoredNetwork::of_checkpoint(&run, CheckpointKind::Last, None).unwrap();
    let camera = stored.camera.unwrap();
    assert!((camera.fx / fx - 1.0).abs() < 1e-9 && (camera.fy / fy - 1.0).abs() < 1e-9);
    assert_eq!((camera.cx, camera.cy), (159.5, 47.5));
    assert_eq!(findings.camera, Some(camera));
}

/// On a straight drive, every focal length explains the images.
#[test]
fn a_straight_drive_leaves_the_focal_length_undetermined() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    folder_without_camera(&straight(40), &at("drive"));
    // With a canonical focal length depth follows f. Then errors in the metres must not change f.
    for canonical_focal_px in [None, Some(60.0)] {
        let mut config = config(30);
        config.validate_every = 30;
        config.canonical_focal_px = canonical_focal_px;
        let sets = samples(&config, &[&at("drive")]);
        let name = format!("run-{canonical_focal_px:?}");
        let outcome = run(&mut start(&config, &at(&name), sets), None);
        let learned = outcome.camera.unwrap();
        assert!(
            !learned.is_reliable(),
            "{canonical_focal_px:?}: {learned:?}"
        );
        let warnings = outcome.warnings;
        assert!(
            warnings.contains(&TrainWarning::CameraUndetermined),
            "{warnings:?}"
        );
    }
}

/// Losses and camera are the same to the last digit, in f32 and, if the processor supports it, in bf16.
#[test]
fn a_resumed_run_learns_the_same_camera() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    folder_without_camera(&bends(24), &at("drive"));
    for precision in [Precision::F32, Precision::Bf16] {
        if !supports(&Device::flex(), precision) {
            eprintln!("skipped: this processor has no bf16");
            continue;
        }
        let mut config = config(6);
        (config.precision, config.batch) = (precision, 2);
        // Then depth and its factors follow the focal length.
        config.canonical_focal_px = Some(60.0);
        let begun = |name: &str| {
            let name = format!("{name}-{precision:?}");
            let sets = samples(&config, &[&at("drive")]);
            (start(&config, &at(&name), sets), name)
        };
        let (mut trainer, _) = begun("whole");
        let whole = run(&mut trainer, None);
        let (mut trainer, name) = begun("parts");
        let mut parts = run(&mut trainer, Some(3));
        let (folder, _) = RunFolder::open(&at(&name)).unwrap();
        let config = folder.read_config().unwrap();
        let sets = samples(&config, &[&at("drive")]);
        let mut trainer = Trainer::resume(config, folder, sets, &Device::flex()).unwrap();
        let rest = run(&mut trainer, None);
        parts.losses.extend(rest.losses);
        assert_eq!(whole.losses, parts.losses, "{precision:?}");
        assert_eq!(whole.camera, rest.camera, "{precision:?}");
        assert_ne!(
            whole.camera.unwrap().focal_px,
            parts.camera.unwrap().focal_px
        );
    }
}

#[test]
fn a_known_camera_and_two_cameras_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    folder_without_camera(&bends(6), &at("one"));
    let wide = SimConfig {
        seed: 3,
        frames: 6,
        width: 160,
        height: 48,
        fps: 5.0,
        scan_every: 0,
        ..SimConfig::default()
    };
    folder_without_camera(&Simulation::new(&wide).unwrap(), &at("two"));
    let config = config(1);
    let refused = |drives: &[&Path], run: &str| {
        let folder = RunFolder::create(&at(run)).unwrap();
        let sets = samples(&config, drives);
        Trainer::create(config.clone(), folder, sets, &Device::flex(), Ok).unwrap_err()
    };
    let error = refused(&[&at("one"), &at("two")], "a");
    assert!(matches!(error, Error::SeveralCameras { .. }));
    for part in ["320x96", "160x48", "one", "two"] {
        assert!(error.to_string().contains(part), "{error}");
    }
    std::fs::write(at("two").join("intrinsics.txt"), "93 92 78 22").unwrap();
    let error = refused(&[&at("two")], "b");
    assert!(matches!(error, Error::CameraKnown { .. }), "{error}");
    assert!(error.hint().unwrap().contains("assumed_camera.learn"));
}
