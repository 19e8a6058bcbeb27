//! What changes during a run: learning rate, loss weights, when a checkpoint is due.

use super::Trainer;
use crate::losses::speed_weight;
use crate::{LearningRateSchedule, PreparedStep, Schedule, TrainConfig};
use deepfusion_kernels::AdamStep;
use std::time::Duration;

/// Share of the learning rate at which the cosine schedule ends.
const COSINE_END: f64 = 0.01;

impl Trainer {
    /// Whether enough time has passed since the last checkpoint to write one between validations.
    pub(super) fn checkpoint_is_due(&self, passed: Duration) -> bool {
        let minutes = self.config.checkpoint_minutes;
        minutes > 0.0 && passed.as_secs_f64() >= 60.0 * minutes
    }

    /// The schedule at the current step.
    pub(super) fn schedule(&self, steps: usize) -> Schedule {
        let (step, loss) = (self.state.step, &self.config.loss);
        Schedule {
            speed_weight: speed_weight(
                loss.speed,
                step,
                steps,
                self.epoch_steps(),
                loss.speed_warmup_steps,
            ),
            masks_active: step as f64 >= loss.moving.warmup_share * steps as f64,
        }
    }

    pub(super) fn learning_rate(&self, steps: usize) -> f64 {
        learning_rate(&self.config, self.state.step, steps)
    }

    /// The step with the focal length's own learning rate, at the same point of the schedule as the networks'.
    pub(super) fn focal_step(&self, step: PreparedStep) -> PreparedStep {
        let own = self.config.learned_camera();
        let share = f64::from(step.settings.learning_rate) / self.config.learning_rate;
        PreparedStep {
            settings: AdamStep {
                learning_rate: own.map_or(0.0, |camera| share * camera.learning_rate) as f32,
                weight_decay: 0.0,
                ..step.settings
            },
            ..step
        }
    }
}

/// The learning rate after `step` of a run's `steps`.
fn learning_rate(config: &TrainConfig, step: usize, steps: usize) -> f64 {
    let planned = config.learning_rate_steps.unwrap_or(steps);
    let done = (step as f64 / planned as f64).min(1.0);
    let factor = match config.learning_rate_schedule {
        LearningRateSchedule::Drop if done < config.learning_rate_drop => 1.0,
        LearningRateSchedule::Drop => 0.1,
        LearningRateSchedule::Cosine => {
            let end = COSINE_END;
            end + (1.0 - end) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos())
        }
    };
    let warmup = config.learning_rate_warmup_steps.max(1) as f64;
    let rise = ((step + 1) as f64 / warmup).min(1.0);
    config.learning_rate * rise * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    #[test]
    fn a_run_may_use_part_of_a_longer_schedule() {
        let whole = TrainConfig {
            learning_rate: 1.0,
            learning_rate_schedule: LearningRateSchedule::Cosine,
            learning_rate_warmup_steps: 0,
            ..Preset::Light.config()
        };
        let part = TrainConfig {
            learning_rate_steps: Some(600),
            ..whole.clone()
        };
        for step in [0, 100, 479] {
            let (of_part, of_whole) = (
                learning_rate(&part, step, 480),
                learning_rate(&whole, step, 600),
            );
            assert_eq!(of_part, of_whole);
        }
        // Four fifths of half a cosine: 0.01 + 0.99 (1 + cos 144°) / 2.
        let end = learning_rate(&part, 480, 480);
        assert!((end - 0.1045).abs() < 1e-4, "{end}");
        assert!((learning_rate(&whole, 480, 480) - 0.01).abs() < 1e-12);
        // Beyond it the rate stays at its end.
        assert_eq!(
            learning_rate(&part, 900, 960),
            learning_rate(&part, 600, 960)
        );
    }
}
