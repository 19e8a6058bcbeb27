//! Numbers that are read late, as on a GPU, tested on the processor.

use super::figures::Monitors;
use super::step::WorkerStep;
use super::*;
use crate::unread::TRANSFERS;
use crate::{NamedGradients, Preset, TrainWarning};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use std::error::Error as StdError;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

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

/// Loaders from the run's first batch on.
fn loaders(trainer: &Trainer) -> Loaders {
    let alone = WorkerGroup::of(Box::new(SingleWorker));
    Loaders::training(&trainer.config, &trainer.train, 0, &alone)
}

/// The first step's losses and gradients, and how often numbers were read.
fn learned(trainer: &Trainer) -> (Result<WorkerStep, Error>, usize) {
    let loaders = loaders(trainer);
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

/// One of two workers, without a sum.
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

/// Reading losses, monitors and norm in a single transfer at a step's end, as several workers do, gives the same as reading batch by batch.
#[test]
fn numbers_read_late_equal_those_read_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let (drive, run) = (drive(folder.path()), |name: &str| folder.path().join(name));
    let (soon, transfers) = learned(&started(&drive, &run("soon"), false, |model| model));
    assert_eq!(transfers, 2);
    let mut trainer = started(&drive, &run("late"), true, |model| model);
    let (waits, transfers) = learned(&trainer);
    assert_eq!((transfers, waits.unwrap().unread.len()), (0, 2));
    trainer.workers = WorkerGroup::of(Box::new(OneOfTwo));
    let (late, transfers) = learned(&trainer);
    assert_eq!(transfers, 1);

    let (soon, late) = (soon.unwrap(), late.unwrap());
    let terms = |step: &WorkerStep| step.figures.losses.named().map(|(_, value)| value);
    assert!(soon.figures.losses.total > 0.0);
    assert_close(terms(&soon), terms(&late));
    let monitors = [&soon, &late].map(|step| &step.figures.monitors);
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
    // One of the two is summed in single precision.
    let ratio = late.gradients.norm() / soon.gradients.norm();
    assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
}

/// A model whose motions are NaN.
fn damaged(mut model: Model) -> Model {
    let output = &mut model.pose_net.as_mut().unwrap().decoder.output;
    let bias = output.bias.take();
    output.bias = bias.map(|b| b.map(|b| b.inner().mul_scalar(f32::NAN).autodiff().require_grad()));
    model
}

/// A loss that is not finite is the same error, for the same batch, whenever it is read.
#[test]
fn a_non_finite_loss_is_the_same_error_whenever_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let [soon, late] = [("soon", false), ("late", true)].map(|(name, reads_late)| {
        let mut trainer = started(&drive, &folder.path().join(name), reads_late, damaged);
        trainer.workers = WorkerGroup::of(Box::new(OneOfTwo));
        let (learned, transfers) = learned(&trainer);
        assert_eq!(transfers, 1);
        let Err(error) = learned else {
            panic!("a step with NaN motions must fail");
        };
        assert!(matches!(error, Error::NotFinite { step: 1, .. }), "{error}");
        error.to_string()
    });
    assert_eq!(soon, late);
}

/// Reads every `together` steps, and not earlier.
fn every(together: usize) -> ReadInterval {
    ReadInterval {
        alone: 0,
        together,
        time: Duration::MAX,
    }
}

/// A run whose numbers are read every `read_every` steps, without held-out samples.
fn run_of(steps: usize, drive: &Path, run: &Path, read_every: Option<usize>) -> Trainer {
    let mut trainer = started(drive, run, read_every.is_some(), |model| model);
    trainer.read_interval = every(read_every.unwrap_or(1));
    // A validation would read the numbers earlier.
    (trainer.config.steps, trainer.config.validate_every) = (Some(steps), 1000);
    trainer.config.clip_norm = 0.05;
    trainer.validation.samples.clear();
    trainer
}

/// What a run reported about its steps.
#[derive(Default)]
struct Reported {
    /// Number, loss, gradient norm and scale ratio of each step.
    steps: Vec<(usize, f64, f64, f64)>,
    /// Number of transfers before each report.
    transfers: Vec<usize>,
    skipped: Vec<usize>,
}

impl Reported {
    fn note(&mut self, event: &TrainEvent) -> Control {
        match event {
            TrainEvent::Step {
                step,
                losses,
                gradient_norm,
                scale_ratio,
                ..
            } => {
                let reported = (*step, losses.total, *gradient_norm, *scale_ratio);
                self.steps.push(reported);
                self.transfers.push(TRANSFERS.get());
            }
            TrainEvent::Warning {
                step,
                warning: TrainWarning::StepSkipped { .. },
            } => self.skipped.push(*step),
            _ => {}
        }
        Control::Continue
    }

    fn numbers(&self) -> Vec<usize> {
        self.steps.iter().map(|step| step.0).collect()
    }

    fn losses(&self) -> impl Iterator<Item = f64> {
        self.steps.iter().map(|step| step.1)
    }
}

fn weights(trainer: &Trainer) -> Vec<f64> {
    let model = trainer.model();
    let networks = [
        deepfusion_nn::weights::collect(&model.depth_net),
        deepfusion_nn::weights::collect(model.pose_net.as_ref().unwrap()),
    ];
    let tensors = networks.iter().flat_map(|n| &n.tensors);
    // Only learned weights: running statistics change with every step, made or skipped.
    let learning = tensors.filter(|(name, _)| !name.contains("running"));
    let values = learning.flat_map(|(_, tensor)| &tensor.values);
    values.map(|v| f64::from(*v)).collect()
}

/// Numbers that are read every few steps, and the weights, are the same as with a read after each step.
#[test]
fn reading_every_few_steps_does_not_change_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let run = |read_every: Option<usize>| {
        let at = folder.path().join(format!("{read_every:?}"));
        let (mut trainer, mut reported) =
            (run_of(12, &drive, &at, read_every), Reported::default());
        let before = TRANSFERS.get();
        let summary = trainer.run(&mut |event| reported.note(&event)).unwrap();
        assert_eq!((summary.step, summary.skipped), (12, 0));
        assert_eq!(reported.numbers(), (1..=12).collect::<Vec<_>>());
        assert_eq!(trainer.adam.steps(), 12);
        reported.transfers.iter_mut().for_each(|t| *t -= before);
        (reported, weights(&trainer))
    };
    let (each, each_weights) = run(Some(1));
    assert_eq!(each.transfers, (1..=12).collect::<Vec<_>>());
    let (some, some_weights) = run(Some(5));
    assert_eq!(some.transfers, [1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3]);
    let figures = |reported: &Reported| {
        let steps = reported.steps.iter();
        let figures = steps.flat_map(|(_, loss, norm, ratio)| [*loss, *norm, *ratio]);
        figures.collect::<Vec<_>>()
    };
    assert_close(figures(&each), figures(&some));
    assert_close(each_weights, some_weights);

    // The processor's own kernels, which round differently.
    let (soon, _) = run(None);
    assert_close(soon.losses().take(1), some.losses().take(1));
    for (a, b) in soon.losses().zip(some.losses()) {
        assert!((a / b - 1.0).abs() < 0.02, "{a} and {b}");
    }
}

/// Makes steps from the results of `learn`.
fn by_hand(
    trainer: &mut Trainer,
    steps: usize,
    reported: &mut Reported,
    learn: fn(&mut Trainer, &Loaders, usize) -> WorkerStep,
) -> (StepReports, Result<(), Error>) {
    let (loaders, mut reports) = (loaders(trainer), StepReports::new(steps));
    for number in 1..=steps {
        let learned = learn(trainer, &loaders, number);
        let mut listen = |event: TrainEvent| reported.note(&event);
        if let Err(error) = trainer.make_step(learned, &mut reports, &mut listen) {
            return (reports, Err(error));
        }
    }
    (reports, Ok(()))
}

/// A NaN gradient skips only its own step, and Adam does not count it.
#[test]
fn a_non_finite_gradient_skips_one_step() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let run = |read_every: Option<usize>| {
        let at = folder.path().join(format!("{read_every:?}"));
        let (mut trainer, mut reported) = (run_of(6, &drive, &at, read_every), Reported::default());
        let (mut reports, made) = by_hand(
            &mut trainer,
            6,
            &mut reported,
            |trainer, loaders, number| {
                let mut learned = trainer.learn(loaders, trainer.schedule(6)).unwrap();
                if number == 3 {
                    let mut values = flat(&learned.gradients);
                    values[7] = f32::NAN;
                    learned.gradients.take_from(&values);
                }
                learned
            },
        );
        made.unwrap();
        let mut listen = |event: TrainEvent| reported.note(&event);
        trainer.report_waiting(&mut reports, &mut listen).unwrap();
        assert_eq!((trainer.state.step, trainer.state.skipped), (6, 1));
        assert_eq!(trainer.adam.steps(), 5);
        assert_eq!(reported.skipped, [3]);
        assert_eq!(reported.numbers(), [1, 2, 3, 4, 5, 6]);
        for (number, loss, norm, _) in &reported.steps {
            assert!(loss.is_finite());
            assert_eq!(norm.is_nan(), *number == 3);
        }
        let weights = weights(&trainer);
        assert!(weights.iter().all(|weight| weight.is_finite()));
        (reported, weights)
    };
    let (each, each_weights) = run(Some(1));
    let (some, some_weights) = run(Some(4));
    assert_close(each.losses(), some.losses());
    assert_close(each_weights, some_weights);
    let (soon, _) = run(None);
    for (a, b) in soon.losses().zip(some.losses()) {
        assert!((a / b - 1.0).abs() < 0.02, "{a} and {b}");
    }
}

/// A NaN loss ends the run when it is read, with an error that names its step. That step was not made, and the steps before it are
/// reported.
#[test]
fn a_non_finite_loss_ends_the_run_when_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let (mut trainer, mut reported) = (
        run_of(6, &drive, &folder.path().join("run"), Some(5)),
        Reported::default(),
    );
    let (_, made) = by_hand(
        &mut trainer,
        6,
        &mut reported,
        |trainer, loaders, number| {
            let good = trainer.model.clone();
            if number == 3 {
                trainer.model = good.clone().map(damaged);
            }
            let learned = trainer.learn(loaders, trainer.schedule(6)).unwrap();
            trainer.model = good;
            learned
        },
    );
    let error = made.unwrap_err();
    assert!(matches!(error, Error::NotFinite { step: 3, .. }), "{error}");
    assert_eq!(reported.numbers(), [1, 2]);
    assert_eq!((trainer.state.step, trainer.adam.steps()), (5, 4));
    assert!(weights(&trainer).iter().all(|weight| weight.is_finite()));
}

/// A checkpoint waits for the numbers of the steps before it, and is not written after a NaN loss.
#[test]
fn nothing_is_saved_after_a_non_finite_loss() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let undamaged: fn(Model) -> Model = |model| model;
    for (name, init) in [("good", undamaged), ("damaged", damaged)] {
        let mut trainer = started(&drive, &folder.path().join(name), true, init);
        trainer.read_interval = every(5);
        (trainer.config.steps, trainer.config.validate_every) = (Some(3), 1000);
        trainer.config.checkpoint_minutes = 1e-9;
        trainer.validation.samples.clear();
        let (before, mut reported) = (weights(&trainer), Reported::default());
        let outcome = trainer.run(&mut |event| reported.note(&event));
        let saved = trainer.folder.checkpoint_path(CheckpointKind::Last);
        if name == "good" {
            assert_eq!(outcome.unwrap().step, 3);
            assert_eq!(reported.numbers(), [1, 2, 3]);
            assert!(saved.exists());
            assert_eq!(trainer.adam.steps(), 3);
        } else {
            let error = outcome.unwrap_err();
            assert!(matches!(error, Error::NotFinite { step: 1, .. }), "{error}");
            assert!(reported.steps.is_empty() && !saved.exists());
            let bits = |weights: Vec<f64>| weights.into_iter().map(f64::to_bits);
            assert!(bits(before).eq(bits(weights(&trainer))), "no step was made");
        }
    }
}

/// A run that is stopped reports all steps that were made, and its checkpoint is that of the last.
#[test]
fn a_stopped_run_reports_and_saves_all_steps_made() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let mut trainer = run_of(9, &drive, &folder.path().join("run"), Some(4));
    let mut reported = Reported::default();
    let summary = trainer.run(&mut |event| {
        reported.note(&event);
        let stops = matches!(event, TrainEvent::Step { step: 2, .. });
        if stops {
            Control::Stop
        } else {
            Control::Continue
        }
    });
    let summary = summary.unwrap();
    assert!(summary.stopped);
    assert_eq!((summary.step, trainer.adam.steps()), (4, 4));
    assert_eq!(reported.numbers(), [1, 2, 3, 4]);
    assert!(
        trainer
            .folder
            .checkpoint_path(CheckpointKind::Last)
            .exists()
    );
}

/// A run that was stopped resumes with Adam's moments and step count, and ends with the same weights as an uninterrupted run.
#[test]
fn a_resumed_run_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    let mut whole = run_of(6, &drive, &folder.path().join("whole"), Some(4));
    whole.run(&mut |_| Control::Continue).unwrap();

    let at = folder.path().join("stopped");
    let mut stopped = run_of(6, &drive, &at, Some(4));
    let summary = stopped.run(&mut |event| match event {
        TrainEvent::Step { step: 1, .. } => Control::Stop,
        _ => Control::Continue,
    });
    assert_eq!(summary.unwrap().step, 4);
    let sets = (stopped.train.clone(), stopped.validation.clone());
    let mut config = stopped.config.clone();
    config.validation_share = 0.0;
    let (run, _) = RunFolder::open(&at).unwrap();
    let mut resumed = Trainer::resume(config, run, sets, &Device::flex()).unwrap();
    assert_eq!((resumed.step(), resumed.adam.steps()), (4, 4));
    (resumed.reads_late, resumed.read_interval) = (true, every(4));
    resumed.run(&mut |_| Control::Continue).unwrap();
    assert_eq!((resumed.step(), resumed.adam.steps()), (6, 6));
    assert_close(weights(&whole), weights(&resumed));
}

/// The first steps are read one by one; later ones after a certain time at the latest.
#[test]
fn steps_are_read_at_the_read_interval() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(folder.path());
    for (interval, expected) in [
        (
            ReadInterval {
                alone: 2,
                ..every(9)
            },
            [1, 2, 3, 3, 3],
        ),
        (
            ReadInterval {
                time: Duration::ZERO,
                ..every(9)
            },
            [1, 2, 3, 4, 5],
        ),
    ] {
        let at = folder.path().join(format!("{}", interval.alone));
        let (mut trainer, mut reported) = (run_of(5, &drive, &at, Some(9)), Reported::default());
        trainer.read_interval = interval;
        let before = TRANSFERS.get();
        trainer.run(&mut |event| reported.note(&event)).unwrap();
        let transfers = reported.transfers.iter().map(|t| t - before);
        assert_eq!(transfers.collect::<Vec<_>>(), expected);
    }
}
