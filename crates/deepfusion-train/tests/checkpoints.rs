//! Resuming a run, and starting a new one from it.

use crate::support::{drive, small};
use burn::tensor::Device;
use deepfusion_hint::Hint;
use deepfusion_model::{Error as ModelError, StoredNetwork};
use deepfusion_nn::weights::{self, Weights};
use deepfusion_nn::{DepthNetConfig, PoseNetConfig, ResNetDepth};
use deepfusion_train::{
    Checkpoint, CheckpointKind, Checkpoints, Control, Error, Model, PosePredictor, Preset,
    RunFolder, TrainConfig, TrainFindings, Trainer,
};
use std::path::Path;

/// A run of two steps with or without a flow decoder, in the folder `name`, on a drive of its own.
fn trained(at: &Path, name: &str, flow: bool) -> (Trainer, RunFolder) {
    let (mut config, train, validation) = small(&drive(&at.join(format!("street-{name}")), 10), 2);
    if flow {
        config.loss.with("flow").unwrap();
    }
    let folder = RunFolder::create(&at.join(name)).unwrap();
    let sets = (train, validation);
    let mut trainer = Trainer::create(config, folder.clone(), sets, &Device::flex(), Ok).unwrap();
    trainer.run(&mut |_| Control::Continue).unwrap();
    (trainer, folder)
}

fn flow_decoder(model: &Model) -> Weights {
    weights::collect(model.flow_decoder.as_ref().unwrap())
}

#[test]
fn a_run_starts_from_the_flow_decoder_too_or_reports_a_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex();
    let (with, run) = trained(folder.path(), "with", true);
    assert_eq!(run.preferred(), CheckpointKind::Best);
    for kind in [CheckpointKind::Best, CheckpointKind::Last] {
        let (model, anew) = run.load_networks(kind, with.config(), &device).unwrap();
        assert_eq!(anew, [""; 0]);
        let new = Model::new(with.config(), &device).unwrap();
        let (saved, new) = (flow_decoder(&model), flow_decoder(&new));
        assert!(saved.tensors != new.tensors, "{kind:?}: it has learned");
        if kind == CheckpointKind::Last {
            assert!(saved.tensors == flow_decoder(with.model()).tensors);
        }
    }

    let (without, run) = trained(folder.path(), "without", false);
    let (_, anew) = run
        .load_networks(CheckpointKind::Best, without.config(), &device)
        .unwrap();
    assert_eq!(anew, [""; 0], "none is wanted");
    let (_, anew) = run
        .load_networks(CheckpointKind::Best, with.config(), &device)
        .unwrap();
    assert_eq!(anew, ["the flow decoder"]);
    // A resumed run must have the decoder that it had.
    let error = run
        .load(CheckpointKind::Last, with.config(), &device)
        .unwrap_err();
    assert!(error.to_string().contains("no flow decoder"), "{error}");
    assert!(error.hint().unwrap().contains("new run from these weights"));
}

#[test]
fn moments_that_do_not_fit_their_parameters_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (trainer, run) = trained(folder.path(), "run", false);
    let path = run.checkpoint_path(CheckpointKind::Last);
    let whole = weights::read(&path).unwrap();
    let name = "adam.m.depth.encoder.bn1.weight";
    let refused = |change: &dyn Fn(&mut Weights)| -> Error {
        let mut changed = whole.clone();
        change(&mut changed);
        weights::write_safetensors(&path, &changed).unwrap();
        run.load(CheckpointKind::Last, trainer.config(), &Device::flex())
            .unwrap_err()
    };
    for length in [7, 9] {
        let error = refused(&|w| {
            let moment = w.tensors.get_mut(name).unwrap();
            moment.values.resize(length, 0.0);
            moment.shape = vec![length];
        });
        let expected = format!("tensor `{name}` has shape [{length}], expected [8]");
        assert!(error.to_string().contains(&expected), "{error}");
        assert!(error.to_string().contains("last.safetensors"), "{error}");
    }
    let error = refused(&|w| {
        w.tensors.remove(name);
    });
    let expected = format!("tensor `{name}` [8] is missing");
    assert!(error.to_string().contains(&expected), "{error}");
    let error = refused(&|w| {
        let moment = w.tensors.remove(name).unwrap();
        w.tensors.insert("adam.m.depth.nothing".into(), moment);
    });
    assert!(
        error.to_string().contains("`adam.m.depth.nothing`"),
        "{error}"
    );
    // With its own file it resumes.
    weights::write_safetensors(&path, &whole).unwrap();
    run.load(CheckpointKind::Last, trainer.config(), &Device::flex())
        .unwrap();
}

/// The paper's network starts from imported ResNet-50 encoders: its last layer is dilated, and the import lacks the other parts. Only the
/// width is smaller here.
#[test]
fn imported_encoders_start_a_network_with_other_parts() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex();
    let narrow = |mut config: TrainConfig| {
        (config.size.width, config.size.height) = (96, 64);
        config.depth_net.encoder = config.depth_net.encoder.with_base_width(4);
        config.pose_net.encoder = config.pose_net.encoder.with_base_width(4);
        config.pose_net.metres_per_unit = 1.0;
        config
    };
    let mut imported = Preset::Light.config();
    imported.depth_net = DepthNetConfig::new(ResNetDepth::ResNet50);
    imported.pose_net = PoseNetConfig::new(ResNetDepth::ResNet50);
    imported.seed = 3;
    let imported = narrow(imported);
    let theirs = Model::new(&imported, &device).unwrap();
    let run = RunFolder::create(folder.path()).unwrap();
    run.write_config(&imported, &TrainFindings::default())
        .unwrap();
    let mut state = Checkpoint {
        step: 0,
        best_validation: None,
        skipped: 0,
        encoders_only: true,
        focal_ratio: None,
    };
    let kind = CheckpointKind::Last;
    run.save(kind, &theirs, None, &state).unwrap();
    assert_eq!(run.read_state(kind).unwrap(), state);
    // A network without a trained decoder must not predict.
    let error = StoredNetwork::of_run(folder.path(), None).unwrap_err();
    assert!(matches!(error, ModelError::EncodersOnly { .. }), "{error}");
    let error = PosePredictor::load(folder.path(), None, &device).unwrap_err();
    assert!(error.to_string().contains("only the encoder"), "{error}");

    let paper = narrow(Preset::Paper.config());
    assert!(paper.depth_net.encoder.is_dilated() && paper.depth_net.hce.is_some());
    let (ours, anew) = run.load_networks(kind, &paper, &device).unwrap();
    assert_eq!(anew, ["everything but the encoders"]);
    let depth = |m: &Model| weights::collect(&m.depth_net.encoder).tensors;
    let pose = |m: &Model| weights::collect(&m.pose_net.as_ref().unwrap().encoder).tensors;
    assert!(depth(&ours) == depth(&theirs) && pose(&ours) == pose(&theirs));
    let new = Model::new(&paper, &device).unwrap();
    assert!(depth(&ours) != depth(&new));
    let decoder = |m: &Model| weights::collect(&m.depth_net.decoder).tensors;
    assert!(decoder(&ours) == decoder(&new), "the rest is the seed's");
    // A different ResNet is still an error.
    let error = run
        .load_networks(kind, &narrow(Preset::Light.config()), &device)
        .unwrap_err();
    assert!(
        matches!(error, Error::Model(ModelError::Network(_))),
        "{error}"
    );

    // From a run that was trained as a whole all parts are taken.
    state.encoders_only = false;
    run.save(kind, &theirs, None, &state).unwrap();
    assert!(run.load_networks(kind, &paper, &device).is_err());
}
