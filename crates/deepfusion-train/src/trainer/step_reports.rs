//! Reports of a run's steps: one at a time, or several together whose numbers waited on the device.

use super::figures::{Figures, Monitors, UnreadStep};
use super::pace::{Pace, Smoothed};
use super::step::WorkerStep;
use super::{MAX_SKIPPED, Trainer};
use crate::adam::MOST_UNDECIDED;
use crate::{Control, Error, StepOutcome, TrainEvent, TrainWarning};
use std::time::Duration;

/// When the numbers that wait on the device are read. A validation, a checkpoint and the run's end always read them first.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReadInterval {
    /// Number of first steps of a call that are read one by one: they show how long a run will take, and most errors occur there.
    pub(super) alone: usize,
    /// Most steps that are read together, limited by [`MOST_UNDECIDED`].
    pub(super) together: usize,
    /// Longest time between two reads, and longest time that the waiting steps may take. Slow steps are awaited one by one, and a run can
    /// only be stopped in response to an event. Measuring the time between reads would not be enough, since steps are queued faster than a
    /// device computes them.
    pub(super) time: Duration,
}

impl ReadInterval {
    pub(super) const USUAL: Self = Self {
        alone: 10,
        together: MOST_UNDECIDED,
        time: Duration::from_secs(1),
    };

    /// Whether the waiting steps are read now, in a call that has reported `reported` steps.
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
    /// Drives and frames of the samples.
    names: Vec<String>,
    /// Number of images of all workers.
    images: usize,
    learning_rate: f64,
}

/// What has been reported about a run's steps, and the steps still to be reported.
pub(super) struct StepReports {
    /// Steps of the whole run.
    pub(super) steps: usize,
    /// Steps reported in this call.
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

    /// The shares of pixels in view and of dynamic pixels.
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
    /// Makes a step, or skips it if its gradient is not finite, and reports it: at once, or, if the device decides, when its numbers are
    /// due to be read.
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

    /// Reads the numbers of the steps that wait on the device, in one transfer, and reports each step. Does nothing if none waits. Until
    /// then the host does not know how many steps Adam has made, so a checkpoint must wait for this.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the first step with such a loss; later steps are not reported. The device has not made that step, so the
    /// weights are still good. Running statistics of batch norms may not be: the forward pass updates them at once, and they stay NaN where
    /// features were NaN. The run ends here before anything is written, and can be resumed from the previous checkpoint.
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
            let outcome = (figures, read.outcome());
            // After a request to stop, steps that were already made are still reported.
            if self.report_step(reports, step, outcome, seconds, listen)? == Control::Stop {
                control = Control::Stop;
            }
        }
        Ok(control)
    }

    /// Reports a step.
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

    /// Ten steps are queued in no time. How long the device takes for them is known from earlier steps.
    #[test]
    fn waiting_steps_take_at_most_a_second() {
        for (seconds, together) in [(0.01, MOST_UNDECIDED), (0.3, 4), (1.5, 1)] {
            let mut pace = Pace::new();
            // The first step compiles kernels.
            pace.step(1, 30.0);
            pace.step(1, seconds);
            let is_due = |waiting: &usize| ReadInterval::USUAL.is_due(10, *waiting, &pace);
            assert_eq!((1..).find(is_due), Some(together), "{seconds}");
        }
    }
}
