//! Numbers that are read at a step's end, as on a GPU, on the processor.

use super::step::Monitors;
use super::*;
use crate::unread::TRANSFERS;
use crate::{NamedGradients, Preset};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use std::error::Error as StdError;
use std::ops::ControlFlow;
use std::path::PathBuf;

fn drive(folder: &Path) -> PathBuf {
    let street = Simulation::new(&SimConfig {
        seed: 5,
        frames: 8,
        scan_every: 0,
        ..SimConfig::default()
    });
    write_kitti(&street.unwrap(), &folder.join("street"), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

/// A run of a small network with two batches a step.
fn started(drive: &Path, run: &Path, reads_late: bool, init: fn(Model) -> Model) -> Trainer {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (96, 64);
    (config.batch, config.accumulate, config.steps) = (2, 2, Some(1));
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(8);
    config.depth_net.decoder.widths = [16, 16, 8, 8, 8];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    let datasets = Dataset::open(drive, &OpenOptions::default()).unwrap();
    let (train, validation, _) = SampleSet::split(&config, datasets, None).unwrap();
    let folder = RunFolder::create(run).unwrap();
    let sets = (train, validation);
    let mut trainer =
        Trainer::create(config, folder, sets, &Device::flex(), |m| Ok(init(m))).unwrap();
    assert!(!trainer.reads_late, "the processor reads at once");
    trainer.reads_late = reads_late;
    trainer
}

/// A first step's losses and gradients, and how often numbers were read.
fn learned(trainer: &Trainer) -> (Result<WorkerStep, Error>, usize) {
    let loaders = Loaders::training(&trainer.config, &trainer.train, 0, &trainer.workers);
    let before = TRANSFERS.get();
    let learned = trainer.learn(&loaders, trainer.schedule(1));
    (learned, TRANSFERS.get() - before)
}

fn flat(gradients: &NamedGradients) -> Vec<f32> {
    let mut flat = Vec::new();
    gradients.append_to(&mut flat);
    flat
}

fn assert_close(ours: impl IntoIterator<Item = f64>, theirs: impl IntoIterator<Item = f64>) {
    let (ours, theirs): (Vec<_>, Vec<_>) =
        (ours.into_iter().collect(), theirs.into_iter().collect());
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(&theirs) {
        assert!((a - b).abs() <= 1e-6 * a.abs().max(1e-3), "{a} and {b}");
    }
}

/// One of two; nothing is added up here.
struct OneOfTwo;

impl Workers for OneOfTwo {
    fn rank(&self) -> usize {
        0
    }

    fn count(&self) -> usize {
        2
    }

    fn sum(&mut self, _: &mut [f32]) -> Result<(), Box<dyn StdError + Send + Sync>> {
        Ok(())
    }
}

/// Losses, monitors and the norm are those that are read batch by batch, in a single transfer.
#[test]
fn numbers_read_at_the_end_are_those_read_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let (drive, run) = (drive(folder.path()), |name: &str| folder.path().join(name));
    let (soon, transfers) = learned(&started(&drive, &run("soon"), false, |model| model));
    assert_eq!(transfers, 2);
    let mut trainer = started(&drive, &run("late"), true, |model| model);
    let (late, transfers) = learned(&trainer);
    assert_eq!(transfers, 1);

    let (soon, late) = (soon.unwrap(), late.unwrap());
    let terms = |step: &WorkerStep| step.losses.named().map(|(_, value)| value);
    assert!(soon.losses.total > 0.0);
    assert_close(terms(&soon), terms(&late));
    let monitors = [&soon, &late].map(|step| &step.monitors);
    assert_eq!(monitors[0].ratio.len(), 2);
    let parts: [fn(&Monitors) -> Vec<f64>; 3] = [
        |m| m.ratio.clone(),
        |m| m.valid.clone(),
        |m| m.moving.clone(),
    ];
    for part in parts {
        assert_close(part(monitors[0]), part(monitors[1]));
    }
    assert_eq!((soon.names, soon.images), (late.names, late.images));
    assert_eq!(flat(&soon.gradients).len(), flat(&late.gradients).len());
    assert_eq!(soon.gradient_norm, None);
    assert_eq!(late.gradient_norm, Some(late.gradients.norm()));
    assert_close(late.gradient_norm, [soon.gradients.norm()]);

    // The gradient of several workers is the mean of theirs, whose norm none of them knows yet.
    trainer.workers = WorkerGroup::of(Box::new(OneOfTwo));
    assert_eq!(learned(&trainer).0.unwrap().gradient_norm, None);
}

/// A loss that is not finite is the same error, of the same batch, whenever it is read.
#[test]
fn a_loss_that_is_not_finite_is_named_either_way() {
    let damaged = |mut model: Model| {
        let output = &mut model.pose_net.as_mut().unwrap().decoder.output;
        output.bias = output
            .bias
            .take()
            .map(|bias| bias.map(|b| b.inner().mul_scalar(f32::NAN).autodiff().require_grad()));
        model
    };
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let [soon, late] = [("soon", false), ("late", true)].map(|(name, reads_late)| {
        let trainer = started(&drive, &folder.path().join(name), reads_late, damaged);
        let (learned, transfers) = learned(&trainer);
        assert_eq!(transfers, 1);
        let Err(error) = learned else {
            panic!("no number says where the camera went");
        };
        assert!(matches!(error, Error::NotFinite { step: 1, .. }), "{error}");
        error.to_string()
    });
    assert_eq!(soon, late);
}
