//! What a run will do, for reading before its first step.

use std::fmt;

use deepfusion_hint::count_of;
use deepfusion_model::{InputSize, Learn, Preset, TrainConfig, ViewMotion};
use deepfusion_train::Trainer;

/// The plan of a run: its network, its images, and the number of steps with its reason.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct TrainingPlan {
    /// The preset of its configuration.
    pub preset: Preset,
    /// Width and height of the network's input, in pixels.
    pub size: InputSize,
    /// Number of video samples in a step; `None` if it does not learn from video.
    pub video: Option<usize>,
    /// Number of images with known depth in a step; `None` if it does not learn from them.
    pub known_depth: Option<usize>,
    /// The length of the run.
    pub length: RunLength,
}

/// The length of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RunLength {
    /// A number of steps.
    Steps(usize),
    /// A number of epochs.
    Epochs(usize),
    /// The minimum number of steps in the configuration, since its epochs would give fewer.
    Least {
        /// The number of steps.
        steps: usize,
        /// The number of epochs requested.
        epochs: usize,
        /// The number of steps in these epochs.
        of_epochs: usize,
    },
}

impl TrainingPlan {
    /// The plan of a trainer.
    #[must_use]
    pub fn of(trainer: &Trainer) -> Self {
        Self::new(trainer.config(), trainer.epoch_steps())
    }

    fn new(config: &TrainConfig, epoch_steps: usize) -> Self {
        let of_epochs = config.epochs * epoch_steps;
        let length = match config.steps {
            None if of_epochs < config.min_steps => RunLength::Least {
                steps: config.steps_of(epoch_steps),
                epochs: config.epochs,
                of_epochs,
            },
            None => RunLength::Epochs(config.epochs),
            Some(steps) => RunLength::Steps(steps),
        };
        let sets = 0..config.data.sets.len().max(1);
        let learned = |from: fn(Learn) -> bool| sets.clone().any(|set| from(config.learn(set)));
        let a_step = |batch: usize| batch * config.accumulate;
        Self {
            preset: config.preset,
            size: config.size,
            video: learned(Learn::from_motion).then(|| a_step(config.batch)),
            known_depth: learned(Learn::from_depth).then(|| a_step(config.depth_batch())),
            length,
        }
    }
}

impl fmt::Display for TrainingPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let InputSize { width, height } = self.size;
        let samples = [
            (self.video, "of video"),
            (self.known_depth, "of known depth"),
        ];
        let samples = samples.into_iter().filter_map(|(count, kind)| {
            let count = count?;
            Some(format!("{count} {kind}"))
        });
        let samples: Vec<String> = samples.collect();
        write!(
            f,
            "{}: images of {width}x{height}, {} per step, {}",
            self.preset,
            samples.join(" and "),
            self.length
        )
    }
}

impl fmt::Display for RunLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Steps(steps) => f.write_str(&count_of(steps, "step")),
            Self::Epochs(epochs) => f.write_str(&count_of(epochs, "epoch")),
            Self::Least {
                steps,
                epochs,
                of_epochs,
            } => write!(
                f,
                "{} (the minimum; {epochs} epochs would be only {of_epochs})",
                count_of(steps, "step")
            ),
        }
    }
}

/// Whether a run warps by PoseNet's pose although it could warp by the vehicle's motion: it learns from the vehicle's speed, and its
/// recordings contain the vehicle's turns.
#[must_use]
pub fn leaves_turns_unused(trainer: &Trainer) -> bool {
    let (config, samples) = (trainer.config(), trainer.samples());
    let unused = config.view_motion == ViewMotion::PoseNet && config.loss.speed > 0.0;
    unused && !samples.samples.is_empty() && samples.without_turns().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_says_how_many_steps_and_why() {
        let mut config = Preset::Tiny.config();
        (config.batch, config.accumulate) = (4, 2);
        (config.epochs, config.steps, config.min_steps) = (20, None, 1200);
        let printed = |config: &TrainConfig, epoch_steps| {
            let plan = TrainingPlan::new(config, epoch_steps).to_string();
            let (start, end) = plan.split_once(": images of ").unwrap();
            assert_eq!(start, "tiny");
            end.split_once(", ").unwrap().1.to_owned()
        };
        assert_eq!(
            printed(&config, 34),
            "8 of video per step, 1200 steps (the minimum; 20 epochs would be only 680)"
        );
        assert_eq!(printed(&config, 340), "8 of video per step, 20 epochs");
        config.steps = Some(1);
        config.data.learn = Learn::Both;
        config.depth_batch = 3;
        assert_eq!(
            printed(&config, 340),
            "8 of video and 6 of known depth per step, 1 step"
        );
        config.data.learn = Learn::Depth;
        assert_eq!(printed(&config, 340), "6 of known depth per step, 1 step");
    }
}
