//! What a run says of its steps: each at once, or some together, whose numbers waited on the device.

use super::figures::{Figures, Monitors, UnreadStep};
use super::pace::{Pace, Smoothed};
use super::step::WorkerStep;
use super::{MAX_SKIPPED, Trainer};
use crate::adam::MOST_UNDECIDED;
use crate::{Control, Error, StepOutcome, TrainEvent, TrainWarning};
use std::time::Duration;

/// When numbers are read that wait on the device. Whatever else is due, a validation, a checkpoint or the run's end, reads them before.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReadInterval {
    /// The first steps of a call are read one by one: they say how long a run will take, and most of what goes wrong does so there.
    pub(super) alone: usize,
    /// So many steps together at most, and no more than [`MOST_UNDECIDED`].
    pub(super) together: usize,
    /// No longer than this after the last ones, nor more steps than take as long: where steps are slow, someone waits for each, and to
    /// stop a run is to answer its event. The clock alone would come late, since a step is queued sooner than a device has made it.
    pub(super) time: Duration,
}

impl ReadInterval {
    pub(super) const USUAL: Self = Self {
        alone: 10,
        together: MOST_UNDECIDED,
        time: Duration::from_secs(1),
    };

    /// Whether steps that wait are read now, in a call that has reported `reported` steps.
    fn is_due(self, reported: usize, waiting: usize, pace: &Pace) -> bool {
        reported < self.alone
            || waiting >= self.together.min(MOST_UNDECIDED)
            || pace.since_lap() >= self.time
            || pace.least_seconds_per_step() * waiting as f64 >= self.time.as_secs_f64()
    }
}

/// A step of the run, made or skipped.
pub(super) struct Step {
    /// Counted from 1.
    number: usize,
    /// Drives and frames.
    names: Vec<String>,
    /// Of all workers.
    images: usize,
    learning_rate: f64,
}

/// What was said of the steps of a run, and those of which nothing was yet.
pub(super) struct StepReports {
    /// Steps of the whole run.
    pub(super) steps: usize,
    /// In this call.
    reported: usize,
    waiting: Vec<(Step, UnreadStep)>,
    skipped_in_row: usize,
    pace: Pace,
    ratio: Smoothed,
    low_view: Smoothed,
    moving: Smoothed,
}

impl StepReports {
    pub(super) fn new(steps: usize) -> Self {
        Self {
            steps,
            reported: 0,
            waiting: Vec::new(),
            skipped_in_row: 0,
            pace: Pace::new(),
            ratio: Smoothed::new(),
            low_view: Smoothed::new(),
            moving: Smoothed::new(),
        }
    }

    /// The shares of pixels that are in view, and of dynamic ones.
    pub(super) fn shares(&self) -> [f64; 2] {
        [self.low_view.value(), self.moving.value()]
    }

    fn add(&mut self, monitors: Monitors) {
        for (all, of_step) in [
            (&mut self.ratio, monitors.ratio),
            (&mut self.low_view, monitors.valid),
            (&mut self.moving, monitors.moving),
        ] {
            of_step.into_iter().for_each(|value| all.add(value));
        }
    }

    fn reading_is_due(&self, interval: ReadInterval) -> bool {
        interval.is_due(self.reported, self.waiting.len(), &self.pace)
    }
}

impl Trainer {
    /// Makes a step of what was learned, or skips it where its gradient is not finite, and says so: at once, or, where the device decides,
    /// when the numbers of the steps are due to be read.
    ///
    /// # Errors
    /// As [`Self::report_waiting`].
    pub(super) fn make_step(
        &mut self,
        learned: WorkerStep,
        reports: &mut StepReports,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<Control, Error> {
        let WorkerStep {
            gradients,
            figures,
            names,
            images,
            unread,
            ..
        } = learned;
        let learning_rate = self.learning_rate(reports.steps);
        let step = Step {
            number: self.state.step + 1,
            names,
            images: images * self.workers.count(),
            learning_rate,
        };
        if self.decides_on_device() {
            let unread = self.step_on_device(unread, &gradients, learning_rate);
            self.state.step += 1;
            reports.waiting.push((step, unread));
            return if reports.reading_is_due(self.read_interval) {
                self.report_waiting(reports, listen)
            } else {
                Ok(Control::Continue)
            };
        }
        let (outcome, prepared) = self.adam.begin(
            &gradients,
            learning_rate,
            self.config.clip_norm,
            self.config.weight_decay,
        );
        if let Some(prepared) = prepared {
            self.apply(prepared, &gradients);
        }
        self.state.step += 1;
        let seconds = reports.pace.lap(1);
        self.report_step(reports, step, (figures, outcome), seconds, listen)
    }

    /// Reads the numbers of the steps that wait on the device, in one transfer, and says of each what it was. Nothing is done where none
    /// waits. Until then the host does not know how many steps Adam has made: a checkpoint has to wait for it.
    ///
    /// # Errors
    /// [`Error::NotFinite`] of the first step with such a loss: nothing is said of the steps after it. The device has not made that step, so
    /// the weights are as good as before. Running statistics of batch norms are not: the forward pass moves them at once, and they stay NaN
    /// where the images' features were. The run ends here, before anything is written, and goes on from the checkpoint before.
    /// [`Error::GradientsNotFinite`].
    pub(super) fn report_waiting(
        &mut self,
        reports: &mut StepReports,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<Control, Error> {
        let waiting = std::mem::take(&mut reports.waiting);
        if waiting.is_empty() {
            return Ok(Control::Continue);
        }
        let unread: Vec<&UnreadStep> = waiting.iter().map(|(_, unread)| unread).collect();
        let read = UnreadStep::read(&unread);
        let made = read.iter().filter(|step| step.is_made).count();
        self.adam.settle(made as u32);
        let seconds = reports.pace.lap(waiting.len());
        let share = 1.0 / self.config.accumulate as f64;
        let mut control = Control::Continue;
        for ((step, unread), read) in waiting.into_iter().zip(read) {
            let figures = unread.figures(&read, share, step.number)?;
            let said = (figures, read.outcome());
            // Who asks to stop hears of the steps that were made already.
            if self.report_step(reports, step, said, seconds, listen)? == Control::Stop {
                control = Control::Stop;
            }
        }
        Ok(control)
    }

    /// Says what a step was.
    fn report_step(
        &mut self,
        reports: &mut StepReports,
        step: Step,
        (figures, outcome): (Figures, StepOutcome),
        seconds: f64,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<Control, Error> {
        reports.reported += 1;
        reports.add(figures.monitors);
        let gradient_norm = match outcome {
            StepOutcome::Done { gradient_norm } => {
                reports.skipped_in_row = 0;
                gradient_norm
            }
            StepOutcome::Skipped => {
                self.state.skipped += 1;
                reports.skipped_in_row += 1;
                if reports.skipped_in_row == MAX_SKIPPED {
                    return Err(Error::GradientsNotFinite {
                        count: reports.skipped_in_row,
                        step: step.number,
                        frames: step.names.join(", "),
                    });
                }
                listen(TrainEvent::Warning {
                    step: step.number,
                    warning: TrainWarning::StepSkipped { frames: step.names },
                });
                f64::NAN
            }
        };
        reports.pace.step(step.images, seconds);
        Ok(listen(TrainEvent::Step {
            step: step.number,
            steps: reports.steps,
            losses: figures.losses,
            learning_rate: step.learning_rate,
            images_per_second: reports.pace.images_per_second(),
            remaining_s: reports.pace.seconds_per_step() * (reports.steps - step.number) as f64,
            scale_ratio: reports.ratio.value(),
            gradient_norm,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The device is asked for ten steps in no time: how long it takes to make them is known from those before.
    #[test]
    fn steps_that_wait_are_made_within_a_second() {
        for (seconds, together) in [(0.01, MOST_UNDECIDED), (0.3, 4), (1.5, 1)] {
            let mut pace = Pace::new();
            // In the first one kernels are compiled.
            pace.step(1, 30.0);
            pace.step(1, seconds);
            let is_due = |waiting: &usize| ReadInterval::USUAL.is_due(10, *waiting, &pace);
            assert_eq!((1..).find(is_due), Some(together), "{seconds}");
        }
    }
}
