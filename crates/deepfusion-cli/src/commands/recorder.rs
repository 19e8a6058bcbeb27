//! Turns a trainer's events into log files, panels and lines on stderr.

use std::path::Path;
use std::time::{Duration, Instant};

use deepfusion_hint::count_of;
use deepfusion_jobs::training::{OtherSetting, Pace, RunLog, TimeEstimate, event_line};
use deepfusion_train::{Control, TrainEvent};

use crate::failure::{Failure, Result};
use crate::interrupt;
use crate::progress::{Progress, duration_text, say};

/// Time between two lines with the losses, if there is no bar.
const LINE_EVERY: Duration = Duration::from_secs(20);

/// Writes the logs of a run and shows its progress.
pub(super) struct Recorder {
    log: RunLog,
    progress: Progress,
    last_line: Instant,
    /// Present if the time that the run will take is to be printed.
    pace: Option<Pace>,
    /// The first failure to write a log, which stops training and is the command's error.
    failure: Option<Failure>,
}

impl Recorder {
    /// For the run in `folder`, continuing after `step`; with a `pace`, prints how long the run will take.
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
            // The disk may be full: saved checkpoints are safe, further steps could be lost.
            self.failure.get_or_insert(error.into());
            return Control::Stop;
        }
        self.say(&event);
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

    fn say(&mut self, event: &TrainEvent) {
        if let TrainEvent::Warning { step, warning } = event {
            tracing::warn!("step {step}: {warning}");
        }
        let Some(line) = event_line(event) else {
            return;
        };
        let &TrainEvent::Step { step, steps, .. } = event else {
            return say(&line);
        };
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
}

/// How long a run will take, and the options that change it.
fn how_long(estimate: &TimeEstimate) -> String {
    let pace = match estimate.step_s {
        s if s < 10.0 => format!("{s:.2} s"),
        s => format!("{s:.0} s"),
    };
    let mut line = format!(
        "about {} from here: {} of {pace}",
        duration_text(estimate.total_s()),
        count_of(estimate.steps, "step")
    );
    let choices = estimate.choices.iter().map(|(choice, total_s)| {
        let option = match choice {
            OtherSetting::Size(size) => format!("--size {}x{}", size.width, size.height),
            OtherSetting::Preset(preset) => format!("--preset {preset}"),
        };
        format!("{option} about {}", duration_text(*total_s))
    });
    let choices: Vec<String> = choices.collect();
    if !choices.is_empty() {
        line.push_str(&format!(
            "; the same number with {} (estimated from multiply-adds)",
            choices.join(", ")
        ));
    }
    if estimate.bf16 {
        line.push_str("; on this processor --set precision=bf16 is faster");
    }
    line.push_str("; --steps N changes the length");
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::{InputSize, Preset};

    #[test]
    fn the_line_names_the_options_that_change_it() {
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
            "about 20:00 min from here: 1200 steps of 1.00 s; the same number with --size 640x192 about 1 h 20 min, --preset tiny about \
             5:00 min (estimated from multiply-adds); --steps N changes the length"
        );
        (estimate.bf16, estimate.step_s) = (true, 12.4);
        estimate.choices.clear();
        let line = how_long(&estimate);
        assert!(
            line.contains("steps of 12 s; on this processor --set precision=bf16"),
            "{line}"
        );
    }
}
