//! Runs without PoseNet: views are warped by the vehicle's motion, and PoseNet would not learn.

use crate::support::{drive, small};
use burn::tensor::Device;
use deepfusion_hint::Hint;
use deepfusion_nn::weights::{WeightTensor, collect, read_safetensors_under};
use deepfusion_train::{
    CheckpointKind, Checkpoints, Control, Error, PosePredictor, RunFolder, TrainConfig, TrainEvent,
    Trainer, ViewMotion,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Two steps with the vehicle's motion, with or without PoseNet.
fn settings(config: &TrainConfig, pose_net: bool) -> TrainConfig {
    let mut config = TrainConfig {
        view_motion: ViewMotion::Vehicle,
        // The gradient's norm would include PoseNet's gradient.
        clip_norm: 0.0,
        ..config.clone()
    };
    if !pose_net {
        config.freeze = vec![TrainConfig::POSE_NET.into()];
    }
    config
}

fn depth_weights(trainer: &Trainer) -> BTreeMap<String, WeightTensor> {
    collect(&trainer.model().depth_net).tensors
}

/// Continues for at most `most` steps. Returns the speed terms and scale ratios of steps and validations.
fn run(trainer: &mut Trainer, most: usize) -> Vec<(f64, f64)> {
    let mut reported = Vec::new();
    trainer
        .run(&mut |event| match event {
            TrainEvent::Step {
                step,
                losses,
                scale_ratio,
                ..
            } => {
                reported.push((losses.speed, scale_ratio));
                if step >= most {
                    Control::Stop
                } else {
                    Control::Continue
                }
            }
            TrainEvent::Validated {
                losses,
                scale_ratio,
                ..
            } => {
                reported.push((losses.speed, scale_ratio));
                Control::Continue
            }
            _ => Control::Continue,
        })
        .unwrap();
    reported
}

/// The depth network learns exactly the same, PoseNet's numbers are absent, and the run can be resumed.
#[test]
fn depth_learns_the_same_without_pose_net() {
    let folder = tempfile::tempdir().unwrap();
    let (config, train, validation) = small(&drive(&folder.path().join("street"), 10), 3);
    let sets = (train, validation);
    let start = |name: &str, config: &TrainConfig| {
        let at = RunFolder::create(&folder.path().join(name)).unwrap();
        Trainer::create(config.clone(), at, sets.clone(), &Device::flex(), Ok).unwrap()
    };
    let mut with = start("with", &settings(&config, true));
    let without = settings(&config, false);
    assert!(without.leaves_pose_net_out() && !settings(&config, true).leaves_pose_net_out());
    let mut whole = start("whole", &without);
    assert!(with.model().pose_net.is_some() && whole.model().pose_net.is_none());
    let before = depth_weights(&with);
    let reported = run(&mut with, 9);
    assert!(
        reported
            .iter()
            .all(|(speed, ratio)| *speed > 0.0 && ratio.is_finite())
    );
    let reported = run(&mut whole, 9);
    assert!(
        reported
            .iter()
            .all(|(speed, ratio)| *speed == 0.0 && ratio.is_nan())
    );
    assert!(depth_weights(&with) != before);
    assert!(depth_weights(&with) == depth_weights(&whole));

    let mut begun = start("parts", &without);
    run(&mut begun, 1);
    let (at, _) = RunFolder::open(&folder.path().join("parts")).unwrap();
    let stored = at.read_config().unwrap();
    let mut resumed = Trainer::resume(stored, at, sets.clone(), &Device::flex()).unwrap();
    run(&mut resumed, 9);
    assert!(depth_weights(&resumed) == depth_weights(&whole));
}

/// The checkpoint has no PoseNet: requesting one is an error, and a run that starts from the checkpoint has a new one.
#[test]
fn the_checkpoint_has_no_pose_net() {
    let folder = tempfile::tempdir().unwrap();
    let (config, train, validation) = small(&drive(&folder.path().join("street"), 10), 1);
    let without = settings(&config, false);
    let at = folder.path().join("run");
    let run_folder = RunFolder::create(&at).unwrap();
    let device = Device::flex();
    let mut trainer =
        Trainer::create(without, run_folder, (train, validation), &device, Ok).unwrap();
    run(&mut trainer, 1);
    let last = at.join("last.safetensors");
    let tensors = |prefix: &str| read_safetensors_under(&last, prefix).unwrap().tensors.len();
    assert!(tensors("depth.") > 0 && tensors("adam.m.depth.") > 0);
    assert_eq!((tensors("pose."), tensors("adam.m.pose.")), (0, 0));

    let error = PosePredictor::load(Path::new(&at), None, &device).unwrap_err();
    assert!(matches!(error, Error::NoPoseNet { .. }), "{error}");
    assert!(error.hint().unwrap().contains("`freeze`"));

    let (run_folder, _) = RunFolder::open(&at).unwrap();
    let mut another = trainer.config().clone();
    another.freeze.clear();
    let started = run_folder.load_networks(CheckpointKind::Last, &another, &device);
    let (model, new) = started.unwrap();
    assert_eq!(new, ["PoseNet"]);
    assert!(model.pose_net.is_some());
    assert!(collect(&model.depth_net).tensors == depth_weights(&trainer));
}
