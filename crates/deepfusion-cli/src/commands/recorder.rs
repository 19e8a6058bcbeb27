//! What becomes of a trainer's events: log files, panels, and lines for the person who waits.

use std::path::Path;
use std::time::{Duration, Instant};

use deepfusion_hint::count_of;
use deepfusion_jobs::training::{OtherSetting, Pace, RunLog, TimeEstimate};
use deepfusion_train::{Control, LossTerms, TrainEvent};

use crate::failure::{Failure, Result};
use crate::interrupt;
use crate::progress::{Progress, clock, say};

/// How often a line has the losses where there is no bar.
const LINE_EVERY: Duration = Duration::from_secs(20);

/// Writes the logs of a run and shows its progress.
pub(super) struct Recorder {
    log: RunLog,
    progress: Progress,
    last_line: Instant,
    /// Where it is to be said how long the run will take.
    pace: Option<Pace>,
    /// The first failure to write a log: training goes on, the command ends with it.
    failure: Option<Failure>,
}

impl Recorder {
    /// For the run in `folder`, going on after `step`; with a `pace` it says how long the run will take.
    pub(super) fn open(folder: &Path, step: usize, pace: Option<Pace>) -> Result<Self> {
        Ok(Self {
            log: RunLog::open(folder, step)?,
            progress: Progress::new("training"),
            last_line: Instant::now(),
            pace,
            failure: None,
        })
    }

    /// Handles an event.
    pub(super) fn handle(&mut self, event: TrainEvent) -> Control {
        if let Err(error) = self.log.write(&event) {
            // A full disk: what is saved is safe, more would be lost.
            self.failure.get_or_insert(error.into());
            return Control::Stop;
        }
        self.say(event);
        if interrupt::asked() {
            Control::Stop
        } else {
            Control::Continue
        }
    }

    /// The first failure to write, if any.
    pub(super) fn finish(self) -> Result<()> {
        match self.failure {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn say(&mut self, event: TrainEvent) {
        match event {
            TrainEvent::Started {
                from_step,
                steps,
                samples,
                validation_samples,
                mean_displacement_m,
            } => {
                let going_on = if from_step > 0 {
                    format!(", going on after step {from_step}")
                } else {
                    String::new()
                };
                // Images that are learned from by their depth have not moved.
                let moved = if mean_displacement_m > 0.0 {
                    format!(", mean displacement {mean_displacement_m:.3} m")
                } else {
                    String::new()
                };
                say(&format!(
                    "{}, {validation_samples} held out{moved}; {}{going_on}",
                    count_of(samples, "training sample"),
                    count_of(steps, "step")
                ));
            }
            TrainEvent::Step {
                step,
                steps,
                losses,
                images_per_second,
                remaining_s,
                scale_ratio,
                ..
            } => {
                let line = format!(
                    "loss {:.4} ({}){}, {images_per_second:.1} images/s, {} left",
                    losses.total,
                    terms_of_a_step(&losses),
                    scale_text(scale_ratio),
                    clock(remaining_s)
                );
                self.progress.note(&line);
                self.progress.set(step, steps);
                if !self.progress.is_bar()
                    && (step <= 1 || step == steps || self.last_line.elapsed() > LINE_EVERY)
                {
                    self.last_line = Instant::now();
                    say(&format!("step {step}/{steps}: {line}"));
                }
                if let Some(pace) = &mut self.pace
                    && let Some(estimate) = pace.after_step(step, steps)
                {
                    say(&how_long(&estimate));
                }
            }
            TrainEvent::Validated {
                step,
                losses,
                selection,
                scale_ratio,
                best,
            } => {
                say(&format!(
                    "step {step}: held out {selection:.4}{} ({}){}",
                    if best { ", the best so far" } else { "" },
                    held_out_terms(&losses),
                    scale_text(scale_ratio),
                ));
            }
            TrainEvent::Camera { camera, learned } => {
                let [fx, fy] = learned.focal_px;
                let spread = match learned.sigma_px {
                    Some([x, y]) => format!("standard deviations {x:.1} and {y:.1}"),
                    None => "not determined by these drives".into(),
                };
                say(&format!(
                    "camera learned: fx {fx:.1}, fy {fy:.1} in pixels of {}x{} ({spread}), the principal point in the middle",
                    camera.width, camera.height
                ));
            }
            TrainEvent::Panel { .. } | TrainEvent::Saved { .. } => {}
            TrainEvent::Warning { step, warning } => {
                tracing::warn!("step {step}: {warning}");
            }
        }
    }
}

/// The terms of what a step learned from.
fn terms_of_a_step(losses: &LossTerms) -> String {
    let mut terms = Vec::new();
    if losses.reprojection > 0.0 {
        terms.push(format!(
            "reprojection {:.4}, smoothness {:.4}",
            losses.reprojection, losses.smoothness
        ));
        terms.extend(speed_text(losses));
    }
    if losses.flow > 0.0 {
        let moving = 100.0 * losses.moving_share;
        terms.push(format!("flow {:.4}, moving {moving:.1} %", losses.flow));
    }
    if losses.depth > 0.0 {
        terms.push(format!("depth {:.4}", losses.depth));
    }
    terms.join(", ")
}

/// Nothing where the run has no PoseNet.
fn speed_text(losses: &LossTerms) -> Option<String> {
    (losses.speed > 0.0).then(|| format!("speed {:.3} m", losses.speed))
}

/// Nothing where no network says a scale.
fn scale_text(ratio: f64) -> String {
    if ratio.is_finite() {
        format!(", scale ratio {ratio:.3}")
    } else {
        String::new()
    }
}

/// What was learned from, of the held-out samples.
fn held_out_terms(losses: &LossTerms) -> String {
    let mut terms = Vec::new();
    if losses.reprojection > 0.0 {
        terms.push(format!("reprojection {:.4}", losses.reprojection));
        terms.extend(speed_text(losses));
    }
    if losses.depth > 0.0 {
        terms.push(format!("depth {:.4}", losses.depth));
    }
    terms.join(", ")
}

/// How long a run will take, and the options that choose otherwise.
fn how_long(estimate: &TimeEstimate) -> String {
    let pace = match estimate.step_s {
        s if s < 10.0 => format!("{s:.2} s"),
        s => format!("{s:.0} s"),
    };
    let mut line = format!(
        "about {} from here: {} of {pace}",
        clock(estimate.total_s()),
        count_of(estimate.steps, "step")
    );
    let choices = estimate.choices.iter().map(|(choice, total_s)| {
        let option = match choice {
            OtherSetting::Size(size) => format!("--size {}x{}", size.width, size.height),
            OtherSetting::Preset(preset) => format!("--preset {preset}"),
        };
        format!("{option} about {}", clock(*total_s))
    });
    let choices: Vec<String> = choices.collect();
    if !choices.is_empty() {
        line.push_str(&format!(
            "; as many with {} (by their multiply-adds)",
            choices.join(", ")
        ));
    }
    if estimate.bf16 {
        line.push_str("; on this processor --set precision=bf16 is nearly twice as fast");
    }
    line.push_str("; --steps N changes the length");
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::{InputSize, Preset};

    #[test]
    fn the_line_names_the_options_that_choose_otherwise() {
        let mut estimate = TimeEstimate {
            steps: 1200,
            step_s: 1.0,
            choices: vec![
                (
                    OtherSetting::Size(InputSize {
                        width: 640,
                        height: 192,
                    }),
                    4800.0,
                ),
                (OtherSetting::Preset(Preset::Tiny), 300.0),
            ],
            bf16: false,
        };
        assert_eq!(
            how_long(&estimate),
            "about 20:00 min from here: 1200 steps of 1.00 s; as many with --size 640x192 about 1 h 20 min, --preset tiny about \
             5:00 min (by their multiply-adds); --steps N changes the length"
        );
        (estimate.bf16, estimate.step_s) = (true, 12.4);
        estimate.choices.clear();
        let line = how_long(&estimate);
        assert!(
            line.contains("steps of 12 s; on this processor --set precision=bf16"),
            "{line}"
        );
    }

    #[test]
    fn what_no_network_says_is_not_printed() {
        let mut losses = LossTerms {
            reprojection: 0.125,
            speed: 0.25,
            ..LossTerms::default()
        };
        assert_eq!(
            held_out_terms(&losses),
            "reprojection 0.1250, speed 0.250 m"
        );
        assert_eq!(scale_text(1.5), ", scale ratio 1.500");
        losses.speed = 0.0;
        assert_eq!(held_out_terms(&losses), "reprojection 0.1250");
        assert_eq!(scale_text(f64::NAN), "");
    }
}
