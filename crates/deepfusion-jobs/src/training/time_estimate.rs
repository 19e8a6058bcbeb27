//! Estimates how long a training will take, from its first steps, and lists alternatives.

use std::time::{Duration, Instant};

use deepfusion_model::{Compute, InputSize, Learn, Preset, Reprojection, TrainConfig};
use deepfusion_nn::ops::{Precision, supports};
use deepfusion_train::Device;

/// Number of steps that the pace is measured over. The first one is left out, since it allocates memory.
const STEPS: usize = 5;
/// Fewer steps suffice once this much time has passed.
const PATIENCE: Duration = Duration::from_secs(20);
/// A run that ends sooner than this needs no estimate.
const SOON_OVER_S: f64 = 30.0;

/// Watches the first steps of a run, then estimates once how long it will take.
#[derive(Debug)]
pub struct Pace {
    config: TrainConfig,
    compute: Compute,
    /// When the first step was done, and its number.
    first: Option<(Instant, usize)>,
    done: bool,
}

/// How long a run will still take.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeEstimate {
    /// Number of steps left.
    pub steps: usize,
    /// Seconds per step.
    pub step_s: f64,
    /// Other settings, with the seconds that the same number of steps would take with them, estimated from multiply-adds.
    pub choices: Vec<(OtherSetting, f64)>,
    /// Whether this processor supports bf16 and it is not used.
    pub bf16: bool,
}

/// Another setting that the user may prefer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherSetting {
    /// A larger input.
    Size(InputSize),
    /// A smaller network.
    Preset(Preset),
}

impl Pace {
    /// The pace of a run with this configuration.
    #[must_use]
    pub fn of(config: TrainConfig, compute: Compute) -> Self {
        Self {
            config,
            compute,
            first: None,
            done: false,
        }
    }

    /// The estimate, returned once, after the first step at which it can be made.
    pub fn after_step(&mut self, step: usize, steps: usize) -> Option<TimeEstimate> {
        if self.done {
            return None;
        }
        let (start, from) = *self.first.get_or_insert_with(|| (Instant::now(), step));
        let (elapsed, counted) = (start.elapsed(), step - from);
        if counted == 0 || (counted < STEPS && elapsed < PATIENCE) {
            return None;
        }
        self.done = true;
        let step_s = elapsed.as_secs_f64() / counted as f64;
        let left = steps - step;
        (step_s * left as f64 > SOON_OVER_S).then(|| self.estimate(step_s, left))
    }

    fn estimate(&self, step_s: f64, steps: usize) -> TimeEstimate {
        let total = step_s * steps as f64;
        let own = work(&self.config) as f64;
        let config = &self.config;
        let on_processor = self.compute == Compute::Processor && config.precision == Precision::F32;
        let choices = self.choices().into_iter();
        TimeEstimate {
            steps,
            step_s,
            choices: choices
                .map(|(choice, config)| (choice, total * work(&config) as f64 / own))
                .collect(),
            bf16: on_processor && supports(&Device::flex(), Precision::Bf16),
        }
    }

    fn choices(&self) -> Vec<(OtherSetting, TrainConfig)> {
        let mut choices = Vec::new();
        let full = Preset::Light.config().size;
        let pixels = |size: InputSize| size.width * size.height;
        if pixels(self.config.size) < pixels(full) {
            let config = TrainConfig {
                size: full,
                ..self.config.clone()
            };
            choices.push((OtherSetting::Size(full), config));
        }
        if self.config.preset != Preset::Tiny {
            let tiny = Preset::Tiny.config_on(self.compute);
            choices.push((OtherSetting::Preset(Preset::Tiny), tiny));
        }
        choices
    }
}

impl TimeEstimate {
    /// Seconds until the end.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.step_s * self.steps as f64
    }
}

/// Multiply-adds of the networks in one forward pass of a step; the backward pass is proportional.
fn work(config: &TrainConfig) -> u64 {
    let depth = config.depth_net.costs(config.size);
    let depth: u64 = depth.iter().map(|part| part.multiply_adds).sum();
    let pose = if config.leaves_pose_net_out() {
        0
    } else {
        config.pose_net.cost(config.size).multiply_adds
    };
    // PoseNet does not use the other camera's view.
    let sources = config.frames.len() as u64;
    // With both directions, the sources have depth, too.
    let depths = match config.reprojection {
        Reprojection::Bidirectional => 1 + sources,
        Reprojection::Minimum | Reprojection::Mean => 1,
    };
    let sets = 0..config.data.sets.len().max(1);
    let learned = |from: fn(Learn) -> bool| sets.clone().any(|set| from(config.learn(set)));
    let mut step = 0;
    if learned(Learn::from_motion) {
        step += config.batch as u64 * (depths * depth + sources * pose);
    }
    if learned(Learn::from_depth) {
        step += config.depth_batch() as u64 * depth;
    }
    config.accumulate as u64 * step
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices(config: TrainConfig, compute: Compute) -> Vec<OtherSetting> {
        let estimate = Pace::of(config, compute).estimate(0.2, 1200);
        estimate.choices.iter().map(|(choice, _)| *choice).collect()
    }

    #[test]
    fn an_estimate_lists_alternative_settings() {
        let full = Preset::Light.config().size;
        let light = Preset::Light.config_on(Compute::Processor);
        let estimate = Pace::of(light.clone(), Compute::Processor).estimate(1.0, 1200);
        assert_eq!(estimate.total_s(), 1200.0);
        let [
            (OtherSetting::Size(size), larger),
            (OtherSetting::Preset(Preset::Tiny), smaller),
        ] = estimate.choices[..]
        else {
            panic!("{:?}", estimate.choices);
        };
        // Four times the pixels are four times the work in every convolution.
        assert_eq!(size, full);
        assert!((larger / 4800.0 - 1.0).abs() < 0.01, "{larger}");
        assert!(smaller < 600.0, "{smaller}");
        assert_eq!(estimate.bf16, supports(&Device::flex(), Precision::Bf16));
        let in_bf16 = TrainConfig {
            precision: Precision::Bf16,
            ..light
        };
        assert!(!Pace::of(in_bf16, Compute::Processor).estimate(1.0, 9).bf16);
        let tiny = choices(Preset::Tiny.config(), Compute::Processor);
        assert_eq!(tiny, [OtherSetting::Size(full)]);
        let full = choices(Preset::Light.config(), Compute::Gpu);
        assert_eq!(full, [OtherSetting::Preset(Preset::Tiny)]);
    }

    #[test]
    fn a_short_run_has_no_estimate() {
        let light = Preset::Light.config_on(Compute::Processor);
        let mut pace = Pace::of(light, Compute::Processor);
        assert!((1..20).all(|step| pace.after_step(step, 20).is_none()));
    }
}
