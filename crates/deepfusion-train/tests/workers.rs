//! Several workers together learn the same as one alone.

use std::error::Error as StdError;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Barrier, Mutex};

use crate::support::{drive, small};
use burn::tensor::Device;
use deepfusion_nn::InputSize;
use deepfusion_train::{
    CheckpointKind, Checkpoints, Control, Error, LossTerms, RunFolder, SampleSet, TrainConfig,
    TrainEvent, Trainer, Workers,
};

/// Workers as threads of one process. If one ends, the others notice at their next sum.
#[derive(Clone)]
struct Threads {
    rank: usize,
    count: usize,
    barrier: Arc<Barrier>,
    sums: Arc<Mutex<Vec<f32>>>,
}

impl Threads {
    fn new(count: usize) -> Vec<Self> {
        let (barrier, sums) = (Arc::new(Barrier::new(count)), Arc::default());
        let of = |rank| Self {
            rank,
            count,
            barrier: Arc::clone(&barrier),
            sums: Arc::clone(&sums),
        };
        (0..count).map(of).collect()
    }
}

impl Workers for Threads {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), Box<dyn StdError + Send + Sync>> {
        for rank in 0..self.count {
            if rank == self.rank {
                let mut sums = self.sums.lock().unwrap();
                if rank == 0 {
                    *sums = vec![0.0; values.len()];
                }
                assert_eq!(sums.len(), values.len());
                sums.iter_mut().zip(&*values).for_each(|(s, v)| *s += v);
            }
            self.barrier.wait();
        }
        values.copy_from_slice(&self.sums.lock().unwrap());
        self.barrier.wait();
        Ok(())
    }
}

type Sets = (SampleSet, SampleSet);

/// Trains with each worker in a thread of its own. Returns each worker's losses by step, or its error.
fn together(
    count: usize,
    out: &Path,
    change: impl Fn(usize, &mut TrainConfig, &mut Sets) + Sync,
    start: &(TrainConfig, Sets),
) -> Vec<Result<Vec<LossTerms>, Error>> {
    let change = &change;
    std::thread::scope(|scope| {
        let handles: Vec<_> = Threads::new(count)
            .into_iter()
            .map(|workers| {
                let (mut config, mut sets) = start.clone();
                scope.spawn(move || {
                    change(workers.rank, &mut config, &mut sets);
                    let folder = match workers.rank {
                        0 => RunFolder::create(out).unwrap(),
                        _ => RunFolder::create(&out.join("unused")).unwrap(),
                    };
                    let workers = Box::new(workers);
                    let device = Device::flex();
                    let mut trainer =
                        Trainer::create_among(workers, config, folder, sets, &device, Ok)?;
                    losses(&mut trainer)
                })
            })
            .collect();
        handles.into_iter().map(|h| h.join().unwrap()).collect()
    })
}

fn losses(trainer: &mut Trainer) -> Result<Vec<LossTerms>, Error> {
    let mut losses = Vec::new();
    trainer.run(&mut |event| {
        if let TrainEvent::Step { losses: step, .. } = event {
            losses.push(step);
        }
        Control::Continue
    })?;
    Ok(losses)
}

fn alone(out: &Path, (config, sets): &(TrainConfig, Sets)) -> Vec<LossTerms> {
    let folder = RunFolder::create(out).unwrap();
    let device = Device::flex();
    let mut trainer = Trainer::create(config.clone(), folder, sets.clone(), &device, Ok).unwrap();
    losses(&mut trainer).unwrap()
}

/// The largest relative difference between two runs' losses.
fn apart(a: &[LossTerms], b: &[LossTerms]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(b).flat_map(|(a, b)| {
        let pairs = a.named().into_iter().zip(b.named());
        pairs.map(|((_, a), (_, b))| (a - b).abs() / a.abs().max(1e-3))
    });
    pairs.fold(0.0, f64::max)
}

fn prepared(at: &Path) -> (TrainConfig, Sets) {
    let (mut config, train, validation) = small(&drive(&at.join("street"), 20), 4);
    // Otherwise batch norms would use the statistics of each worker's own batch.
    config.depth_net.encoder.frozen_statistics = true;
    config.pose_net.encoder.frozen_statistics = true;
    (config, (train, validation))
}

/// With batches of several sizes, all workers' batches of a step have the same size.
#[test]
fn all_workers_have_the_same_size_in_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { folder.path().join(name) };
    let (mut config, sets) = prepared(folder.path());
    (config.batch, config.accumulate, config.steps) = (1, 1, Some(2));
    config.canonical_focal_px = Some(60.0);
    // So small that the weights stay practically the same.
    config.learning_rate = 1e-12;
    config.augmentation.video_sizes = vec![InputSize {
        width: 128,
        height: 64,
    }];
    let start = (config.clone(), sets.clone());
    let shared = together(2, &at("two"), |_, _, _| {}, &start);
    let two = shared[0].as_ref().unwrap();
    // The same two samples in one batch.
    config.batch = 2;
    let one = alone(&at("one"), &(config.clone(), sets.clone()));
    assert_eq!(two.len(), 2);
    let apart = |a: &LossTerms, b: &LossTerms| (a.reprojection - b.reprojection).abs();
    assert!(one.iter().zip(two).all(|(a, b)| apart(a, b) < 1e-5));
    // A different size changes the losses.
    config.augmentation.video_sizes.clear();
    let own = alone(&at("own"), &(config, sets));
    assert!(apart(&one[1], &own[1]) > 1e-4);
}

fn weights(run: &Path, config: &TrainConfig) -> Vec<f32> {
    let (folder, _) = RunFolder::open(run).unwrap();
    let config = folder.read_findings().unwrap().complete(config.clone());
    let device = Device::flex().autodiff();
    let (model, ..) = folder.load(CheckpointKind::Last, &config, &device).unwrap();
    let all = deepfusion_nn::weights::collect(&model.depth_net);
    all.tensors.into_values().flat_map(|t| t.values).collect()
}

#[test]
fn two_workers_learn_what_one_learns_with_twice_the_batches() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { folder.path().join(name) };
    let (mut config, sets) = prepared(folder.path());
    (config.batch, config.accumulate) = (1, 1);
    let start = (config.clone(), sets.clone());
    let shared = together(2, &at("two"), |_, _, _| {}, &start);
    let [first, second] = &shared.try_into().unwrap();
    let (first, second) = (first.as_ref().unwrap(), second.as_ref().unwrap());
    assert_eq!(first.len(), 4);
    // All workers report the losses of the whole step.
    assert!(apart(first, second) == 0.0);
    // Only the first one writes.
    assert!(!at("two").join("unused/config.toml").exists());

    // The same samples, one batch after the other.
    config.accumulate = 2;
    let one = alone(&at("one"), &(config.clone(), sets.clone()));
    assert!(apart(&one, first) < 1e-4, "{}", apart(&one, first));
    let (a, b) = (weights(&at("one"), &config), weights(&at("two"), &config));
    let most = a
        .iter()
        .zip(&b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(most < 1e-4, "{most}");

    // The same samples in one batch.
    (config.batch, config.accumulate) = (2, 1);
    let at_once = alone(&at("at_once"), &(config, sets));
    assert!(apart(&at_once, first) < 1e-4, "{}", apart(&at_once, first));
}

#[test]
fn a_worker_that_fails_ends_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let start = prepared(folder.path());
    let out = folder.path().join("run");
    let results = together(
        2,
        &out,
        |rank, _, (train, _)| {
            if rank == 1 {
                // Only the first sample's sources exist.
                let sources = train.samples[1..]
                    .iter_mut()
                    .flat_map(|s| &mut s.snippet.sources);
                sources.for_each(|source| source.frame = 999_999);
            }
        },
        &start,
    );
    let [first, second] = results.map_errors();
    assert!(
        first.contains("worker 0 of 2: another worker has failed"),
        "{first}"
    );
    assert!(second.contains("loader"), "{second}");
}

#[test]
fn workers_that_differ_do_not_begin() {
    let folder = tempfile::tempdir().unwrap();
    let start = prepared(folder.path());
    type Change = fn(usize, &mut TrainConfig, &mut Sets);
    let cases: [(&str, &str, Change); 5] = [
        ("weights", "different weights", |rank, config, _| {
            config.seed += rank as u64;
        }),
        ("samples", "different samples", |rank, _, (train, _)| {
            train.samples.truncate(train.samples.len() - rank);
        }),
        ("drives", "different samples", |rank, _, (train, _)| {
            let last = train.samples.len() - 1;
            train.samples.swap(0, rank * last);
        }),
        ("settings", "different settings", |rank, config, _| {
            config.learning_rate *= 1.0 + rank as f64;
        }),
        ("loss", "different settings", |rank, config, _| {
            config.loss.smoothness *= 1.0 + rank as f64;
        }),
    ];
    for (name, reason, change) in cases {
        let results = together(2, &folder.path().join(name), change, &start);
        for error in results.map_errors() {
            assert!(error.contains(reason), "{error}");
        }
    }
}

trait Errors {
    fn map_errors(self) -> [String; 2];
}

impl Errors for Vec<Result<Vec<LossTerms>, Error>> {
    fn map_errors(self) -> [String; 2] {
        let errors: Vec<String> = self
            .into_iter()
            .map(|r| r.unwrap_err().to_string())
            .collect();
        errors.try_into().unwrap()
    }
}
