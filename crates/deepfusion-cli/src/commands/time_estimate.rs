//! How long a training will take, from its first steps, and what else could be chosen.

use std::time::{Duration, Instant};

use burn::tensor::Device;
use deepfusion_model::{Compute, InputSize, Learn, Preset, Reprojection, TrainConfig};
use deepfusion_nn::ops::{Precision, supports};

use crate::progress::clock;

/// Steps that the pace is taken from. The first is left out: it allocates.
const STEPS: usize = 5;
/// A pace of fewer steps will do once so much time has gone.
const PATIENCE: Duration = Duration::from_secs(20);

/// Watches the first steps of a run, then says once how long it will take.
pub(super) struct TimeEstimate {
    config: TrainConfig,
    compute: Compute,
    /// Whether bf16 could be chosen and is not.
    bf16: bool,
    /// When the first step was done, and which it was.
    first: Option<(Instant, usize)>,
    done: bool,
}

impl TimeEstimate {
    /// Of a run with this configuration.
    pub(super) fn new(config: TrainConfig, compute: Compute) -> Self {
        let on_processor = compute == Compute::Processor && config.precision == Precision::F32;
        Self {
            bf16: on_processor && supports(&Device::flex(), Precision::Bf16),
            config,
            compute,
            first: None,
            done: false,
        }
    }

    /// The line to print after a step, where now is the time for it.
    pub(super) fn after_step(&mut self, step: usize, steps: usize) -> Option<String> {
        if self.done {
            return None;
        }
        let (start, from) = *self.first.get_or_insert_with(|| (Instant::now(), step));
        let (elapsed, counted) = (start.elapsed(), step - from);
        if counted == 0 || (counted < STEPS && elapsed < PATIENCE) {
            return None;
        }
        self.done = true;
        let pace = elapsed.as_secs_f64() / counted as f64;
        // A run that is over before anyone could choose otherwise needs no advice.
        let left = pace * (steps - step) as f64;
        (left > 30.0).then(|| self.line(pace, steps - step))
    }

    fn line(&self, pace: f64, left: usize) -> String {
        let total = pace * left as f64;
        let mut line = format!(
            "about {} from here: {left} steps of {}",
            clock(total),
            seconds(pace)
        );
        let own = work(&self.config);
        let choices = self.choices().into_iter().map(|(option, config)| {
            let estimate = total * work(&config) as f64 / own as f64;
            format!("{option} about {}", clock(estimate))
        });
        let choices: Vec<String> = choices.collect();
        if !choices.is_empty() {
            line.push_str(&format!(
                "; as many with {} (by their multiply-adds)",
                choices.join(", ")
            ));
        }
        if self.bf16 {
            line.push_str("; on this processor --set precision=bf16 is nearly twice as fast");
        }
        line.push_str("; --steps N changes the length");
        line
    }

    /// Other settings that a user may want, as the options that choose them.
    fn choices(&self) -> Vec<(String, TrainConfig)> {
        let mut choices = Vec::new();
        let full = Preset::Light.config();
        let pixels = |size: InputSize| size.width * size.height;
        if pixels(self.config.size) < pixels(full.size) {
            let InputSize { width, height } = full.size;
            let config = TrainConfig {
                size: full.size,
                ..self.config.clone()
            };
            choices.push((format!("--size {width}x{height}"), config));
        }
        if self.config.preset != Preset::Tiny {
            let tiny = Preset::Tiny.config_on(self.compute);
            choices.push((format!("--preset {}", Preset::Tiny), tiny));
        }
        choices
    }
}

/// Multiply-adds of the networks in one step, forward; backward goes along with it.
fn work(config: &TrainConfig) -> u64 {
    let depth = config.depth_net.costs(config.size);
    let depth: u64 = depth.iter().map(|part| part.multiply_adds).sum();
    let pose = config.pose_net.cost(config.size).multiply_adds;
    // PoseNet does not look at the other camera's view.
    let sources = config.frames.len() as u64;
    // Both ways, the sources have depth, too.
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

fn seconds(pace: f64) -> String {
    if pace < 10.0 {
        format!("{pace:.2} s")
    } else {
        format!("{pace:.0} s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_names_what_else_could_be_chosen() {
        let light = Preset::Light.config_on(Compute::Processor);
        let line = TimeEstimate::new(light.clone(), Compute::Processor).line(1.0, 1200);
        assert!(
            line.starts_with("about 20:00 min from here: 1200 steps of 1.00 s; "),
            "{line}"
        );
        // Four times the pixels are four times the work of every convolution.
        assert!(line.contains("--size 640x192 about 1 h 20 min"), "{line}");
        assert!(line.contains("--preset tiny about "), "{line}");
        assert!(work(&Preset::Tiny.config()) * 2 < work(&light));

        let mut time_estimate = TimeEstimate::new(light, Compute::Processor);
        assert_eq!(
            time_estimate.bf16,
            supports(&Device::flex(), Precision::Bf16)
        );
        for bf16 in [false, true] {
            time_estimate.bf16 = bf16;
            let said = time_estimate
                .line(1.0, 1200)
                .contains("--set precision=bf16");
            assert_eq!(said, bf16);
        }

        let tiny = TimeEstimate::new(Preset::Tiny.config(), Compute::Processor).line(0.2, 1200);
        assert!(!tiny.contains("--preset"), "{tiny}");
        let full = TimeEstimate::new(Preset::Light.config(), Compute::Gpu).line(0.2, 12_000);
        assert!(!full.contains("--size"), "{full}");
    }

    #[test]
    fn nothing_is_said_of_a_run_that_is_soon_over() {
        let light = Preset::Light.config_on(Compute::Processor);
        let mut time_estimate = TimeEstimate::new(light, Compute::Processor);
        let said: Vec<_> = (1..20)
            .filter_map(|step| time_estimate.after_step(step, 20))
            .collect();
        assert_eq!(said, Vec::<String>::new());
    }
}
