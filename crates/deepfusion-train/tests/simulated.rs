//! Tests against the simulator's ground truth.

use crate::support::{drive, small, street};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::to_chw;
use deepfusion_geometry::Se3;
use deepfusion_model::Error as ModelError;
use deepfusion_nn::PoseNet;
use deepfusion_train::{
    BatchLoader, CheckpointKind, Checkpoints, CompareAt, Control, Error, LossTerms, Model, Motion,
    Reprojection, RunFolder, SampleSet, Schedule, TrainConfig, TrainEvent, Trainer, ViewMotion,
    synthesise, validation_loss,
};

fn matrix(m: &nalgebra::Matrix3<f64>, device: &Device) -> Tensor<3> {
    let values: Vec<f32> = (0..9).map(|i| m[(i / 3, i % 3)] as f32).collect();
    Tensor::from_data(TensorData::new(values, [1, 3, 3]), device)
}

fn motion(a_from_b: &Se3, device: &Device) -> Motion {
    let t = a_from_b.translation();
    Motion {
        rotation: matrix(&a_from_b.rotation(), device),
        translation: Tensor::from_data([[t.x as f32, t.y as f32, t.z as f32]], device),
    }
}

fn values(tensor: Tensor<4>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

/// Warping frame 1 with frame 0's true depth and the true motion gives frame 0: every sign and convention of back-projection, motion,
/// projection and sampling. Only pixels whose point is visible in both frames count: its depth in frame 1 equals the depth there.
#[test]
fn the_true_depth_and_motion_reproduce_the_other_frame() {
    let device = Device::flex();
    let simulation = street(12);
    let (h, w) = (192, 640);
    let k = simulation.intrinsics();
    for (a, b) in [(3, 4), (9, 8)] {
        let (target, source) = (simulation.frame(a), simulation.frame(b));
        let source_from_target = source.world_from_cam.inverse() * target.world_from_cam;
        let image = |rgb| Tensor::from_data(TensorData::new(to_chw(rgb), [1, 3, h, w]), &device);
        // The sky has no depth; far away it does not move with the camera's translation.
        let inverse: Vec<f32> = target
            .depth
            .data
            .iter()
            .map(|d| if *d > 0.0 { 1.0 / *d } else { 1e-6 })
            .collect();
        let depth = Tensor::from_data(TensorData::new(inverse, [1, 1, h, w]), &device);
        let out = synthesise(
            image(&source.rgb),
            depth,
            &motion(&source_from_target, &device),
            &matrix(&k.matrix(), &device),
            &matrix(&k.inverse_matrix(), &device),
        );
        let (warped, valid) = (values(out.image), values(out.valid.float()));
        let expected = to_chw(&target.rgb);
        let unwarped = to_chw(&source.rgb);
        let (mut error, mut still, mut count) = (0.0_f64, 0.0_f64, 0);
        for y in 0..h {
            for x in 0..w {
                let (Some(d), true) = (target.depth.get(x, y), valid[y * w + x] > 0.5) else {
                    continue;
                };
                let point = k.back_project(x as f64, y as f64, f64::from(d));
                let there = source_from_target.transform(&point);
                let Some(pixel) = k.project(&there) else {
                    continue;
                };
                let seen = source
                    .depth
                    .get(pixel.x.round() as usize, pixel.y.round() as usize);
                if !seen.is_some_and(|s| (f64::from(s) - there.z).abs() < 0.05 * there.z) {
                    continue;
                }
                for c in 0..3 {
                    let i = (c * h + y) * w + x;
                    error += f64::from((warped[i] - expected[i]).abs());
                    still += f64::from((unwarped[i] - expected[i]).abs());
                    count += 1;
                }
            }
        }
        let n = f64::from(count);
        assert!(n > 0.5 * 3.0 * (h * w) as f64, "{n} values compared");
        assert!(error / n < 0.02, "mean absolute error {}", error / n);
        assert!(
            still / n > 2.0 * error / n,
            "standing still explains as much: {}",
            still / n
        );
    }
}

/// Runs to the end or to `stop`. Returns the losses of all steps and validations.
fn losses(trainer: &mut Trainer, stop: Option<usize>) -> Vec<(usize, LossTerms)> {
    let mut all = Vec::new();
    trainer
        .run(&mut |event| {
            match event {
                TrainEvent::Step { step, losses, .. } => {
                    all.push((step, losses));
                    if stop == Some(step) {
                        return Control::Stop;
                    }
                }
                TrainEvent::Validated { step, losses, .. } => all.push((step, losses)),
                _ => {}
            }
            Control::Continue
        })
        .unwrap();
    all
}

#[test]
fn a_resumed_run_repeats_the_uninterrupted_one_to_the_last_digit() {
    resumed_equals_whole(|_| {});
}

#[test]
fn a_resumed_run_with_every_loss_term_repeats_the_uninterrupted_one() {
    let whole = resumed_equals_whole(|config| {
        for term in ["affine", "flow", "moving"] {
            config.with(term).unwrap();
        }
        config.loss.moving.warmup_share = 0.2;
    });
    let steps: Vec<_> = whole.iter().filter(|(_, l)| l.flow > 0.0).collect();
    assert_eq!(
        steps.len(),
        7,
        "the flow loss exists in training, but not in validation"
    );
    assert!(whole.iter().all(|(_, l)| l.affine > 0.0));
    // The agreement starts after a warm-up of the flow: 20 % of seven steps.
    let agreeing: Vec<_> = steps.iter().map(|(_, l)| l.agreement > 0.0).collect();
    assert_eq!(agreeing, [false, false, true, true, true, true, true]);
}

/// Trains seven steps at once, and again with an interruption after three. Returns the losses.
fn resumed_equals_whole(change: impl Fn(&mut TrainConfig)) -> Vec<(usize, LossTerms)> {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 14);
    let device = Device::flex();
    let start = |name: &str| {
        let (mut config, train, validation) = small(&drive, 7);
        change(&mut config);
        let folder = RunFolder::create(&folder.path().join(name)).unwrap();
        Trainer::create(config, folder, (train, validation), &device, Ok).unwrap()
    };
    let whole = losses(&mut start("whole"), None);
    let mut parts = losses(&mut start("parts"), Some(3));
    let (run, _) = RunFolder::open(&folder.path().join("parts")).unwrap();
    let config = run.read_config().unwrap();
    let (_, train, validation) = small(&drive, 7);
    let mut resumed = Trainer::resume(config, run, (train, validation), &device).unwrap();
    assert_eq!(resumed.step(), 3);
    parts.extend(losses(&mut resumed, None));
    assert_eq!(whole, parts);
    assert!(
        whole
            .iter()
            .all(|(_, l)| l.total.is_finite() && l.total > 0.0)
    );
    whole
}

/// Checkpoints between validations are due by time, have the current step, and do not change what is learned.
#[test]
fn checkpoints_are_written_when_they_are_due() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 8);
    let device = Device::flex();
    let steps_saved = |minutes: f64| {
        let (mut config, train, validation) = small(&drive, 4);
        config.validate_every = 3;
        config.checkpoint_minutes = minutes;
        let path = folder.path().join(format!("every-{minutes}"));
        let run = RunFolder::create(&path).unwrap();
        let mut trainer =
            Trainer::create(config, run.clone(), (train, validation), &device, Ok).unwrap();
        let (mut saved, mut losses) = (Vec::new(), Vec::new());
        trainer
            .run(&mut |event| {
                match event {
                    TrainEvent::Saved { step, path } if path.ends_with("last.safetensors") => {
                        let config = run.read_config().unwrap();
                        let (_, adam, state) = run
                            .load(CheckpointKind::Last, &config, &device.clone().autodiff())
                            .unwrap();
                        assert!(adam.is_some());
                        assert_eq!(state.step, step);
                        saved.push(step);
                    }
                    TrainEvent::Step { losses: of, .. } => losses.push(of),
                    _ => {}
                }
                Control::Continue
            })
            .unwrap();
        (saved, losses)
    };
    // So short that a checkpoint is due after every step.
    let (often, learned) = steps_saved(1e-12);
    assert_eq!(often, [1, 2, 3, 4]);
    let (never, the_same) = steps_saved(0.0);
    assert_eq!(never, [3, 4]);
    assert_eq!(learned, the_same);
}

/// Of two frames, each is the target of the other. Three frames have one target, and flows to both sides.
#[test]
fn every_target_has_its_flows_with_both_reprojections() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, samples, _) = small(&drive(folder.path(), 8), 1);
    let device = Device::flex().autodiff();
    config.loss.with("flow").unwrap();
    config.pose_net.metres_per_unit = 0.8;
    for (reprojection, frames, targets) in [
        (Reprojection::Bidirectional, vec![1], 4),
        (Reprojection::Minimum, vec![-1, 1], 2),
    ] {
        (config.reprojection, config.frames) = (reprojection, frames);
        let datasets = samples.datasets.clone();
        let (samples, _, _) = SampleSet::split(&config, datasets.to_vec(), None).unwrap();
        let model = Model::new(&config, &device).unwrap();
        let batch = BatchLoader::training(&config, samples, 0)
            .next(&device)
            .unwrap()
            .unwrap();
        let pass = model.forward(&batch);
        assert_eq!(pass.flows.len(), config.frames.len());
        for view in &pass.flows {
            assert_eq!(view.flow.dims(), [targets, 2, 64, 96]);
            assert_eq!(view.back.dims(), [targets, 2, 64, 96]);
        }
        assert_eq!(pass.disparities[0].dims(), [targets, 1, 64, 96]);
        let schedule = Schedule {
            speed_weight: 0.2,
            masks_active: true,
        };
        let loss = model.loss(&pass, &batch, schedule);
        assert!(loss.terms.flow > 0.0 && loss.terms.total.is_finite());
    }
}

#[test]
fn a_checkpoint_of_another_network_is_refused_by_its_tensor() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 8);
    let (config, train, validation) = small(&drive, 1);
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let device = Device::flex();
    let mut trainer = Trainer::create(
        config.clone(),
        run.clone(),
        (train, validation),
        &device,
        Ok,
    )
    .unwrap();
    losses(&mut trainer, None);
    let mut wider = trainer.config().clone();
    wider.depth_net.encoder = wider.depth_net.encoder.with_base_width(16);
    let error = run.load(CheckpointKind::Last, &wider, &device).unwrap_err();
    assert!(error.to_string().contains("encoder"), "{error}");
    assert!(matches!(error, Error::Model(ModelError::Network(_))));
    // An existing run is not overwritten.
    assert!(matches!(
        RunFolder::create(run.path()),
        Err(ModelError::RunExists { .. })
    ));
}

/// Mirrored samples have a mirrored camera and motion. A batch's content depends on its number alone.
#[test]
fn batches_are_reproducible() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 8);
    let (config, train, _) = small(&drive, 1);
    let device = Device::flex();
    let third = |first: usize| {
        let loader = BatchLoader::training(&config, train.clone(), first);
        (first..2).for_each(|_| drop(loader.next(&device)));
        loader.next(&device).unwrap().unwrap()
    };
    let (a, b) = (third(0), third(2));
    assert_eq!(a.names, b.names);
    assert_eq!(values(a.clean[1].clone()), values(b.clean[1].clone()));
    assert_eq!(values(a.network[0].clone()), values(b.network[0].clone()));
    let distances: Vec<f32> = a.distance_m[0].clone().into_data().try_into_vec().unwrap();
    assert!(
        distances.iter().all(|d| (0.1..2.0).contains(d)),
        "{distances:?}"
    );
}

/// Views are warped by PoseNet's motion, by PoseNet's motion at the measured distance, or by the vehicle's motion.
#[test]
fn views_are_warped_by_the_configured_motion() {
    let folder = tempfile::tempdir().unwrap();
    let (config, samples, _) = small(&drive(folder.path(), 8), 1);
    let device = Device::flex().autodiff();
    let reprojection = |view_motion, compare_at, metres_per_unit, seed| {
        let mut config = config.clone();
        config.view_motion = view_motion;
        config.loss.compare_at = compare_at;
        config.pose_net.metres_per_unit = metres_per_unit;
        let mut model = Model::new(&config, &device).unwrap();
        model.pose_net = Some(PoseNet::with_seed(&config.pose_net, seed, &device).unwrap());
        let (losses, _) = validation_loss(&model, &config, &samples, &device).unwrap();
        losses.reprojection
    };
    for compare_at in [CompareAt::Full, CompareAt::Own] {
        let of = |motion, metres, seed| reprojection(motion, compare_at, metres, seed);
        // Whether the length of PoseNet's translation matters, and whether other weights of PoseNet matter.
        for (motion, length, net) in [
            (ViewMotion::PoseNet, true, true),
            (ViewMotion::Distance, false, true),
            (ViewMotion::Vehicle, false, false),
        ] {
            let here = of(motion, 20.0, 1);
            for (other, matters) in [(of(motion, 400.0, 1), length), (of(motion, 20.0, 2), net)] {
                let difference = (here - other).abs();
                let as_expected = if matters {
                    difference > 1e-4
                } else {
                    difference < 1e-6
                };
                assert!(as_expected, "{motion:?} {compare_at:?}: {here} {other}");
            }
        }
    }
}
