//! The numbers of a step: first on the device, batch by batch, then read.

use crate::unread::{BatchNumbers, Unread, transfer};
use crate::{Error, LossTerms, StepOutcome};
use burn::tensor::{Bool, Tensor};

/// A batch whose numbers are still on the device.
pub(super) struct UnreadBatch {
    pub(super) numbers: Unread,
    /// Drives and frames of the samples.
    pub(super) names: Vec<String>,
    pub(super) is_video: bool,
    /// Whether the run's scale ratio is taken from it: from known depth only if no PoseNet learns from video.
    pub(super) gives_scale: bool,
}

/// Numbers of each batch that are smoothed over the steps.
#[derive(Default)]
pub(super) struct Monitors {
    pub(super) ratio: Vec<f64>,
    pub(super) valid: Vec<f64>,
    pub(super) moving: Vec<f64>,
}

/// The numbers of a step's batches.
#[derive(Default)]
pub(super) struct Figures {
    /// The mean losses over the batches.
    pub(super) losses: LossTerms,
    pub(super) monitors: Monitors,
}

impl Figures {
    /// Adds a batch that is a `share` of the step.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming the first term that is not finite.
    pub(super) fn add(
        &mut self,
        batch: &UnreadBatch,
        numbers: &BatchNumbers,
        share: f64,
        step: usize,
    ) -> Result<(), Error> {
        let terms = &numbers.terms;
        if let Some((term, value)) = terms.not_finite() {
            return Err(Error::NotFinite {
                step,
                term,
                value,
                frames: batch.names.join(", "),
            });
        }
        self.losses.add(terms, share);
        if batch.is_video {
            self.monitors.valid.push(terms.valid_share);
            self.monitors.moving.push(terms.moving_share);
        }
        if batch.gives_scale {
            self.monitors.ratio.push(numbers.scale_ratio);
        }
        Ok(())
    }
}

/// A step that the device has decided about, with its numbers still there.
pub(super) struct UnreadStep {
    batches: Vec<UnreadBatch>,
    /// The terms of all batches, the gradient's sum of squares, 1 if the step was made and 0 if not, and the values of the scale ratio.
    values: Tensor<1>,
}

impl UnreadStep {
    /// `checked` are the values that must be finite: the batches' terms and the gradient's sum of squares, in this order.
    pub(super) fn new(
        mut batches: Vec<UnreadBatch>,
        checked: [Tensor<1>; 2],
        is_made: Tensor<1, Bool>,
    ) -> Self {
        let mut values: Vec<_> = checked.into();
        values.push(is_made.float());
        for batch in &mut batches {
            values.extend(batch.numbers.take_scale());
        }
        Self {
            batches,
            values: Tensor::cat(values, 0),
        }
    }

    /// Reads the numbers of steps in one transfer from the device.
    pub(super) fn read(steps: &[&Self]) -> Vec<ReadStep> {
        let values = steps.iter().map(|step| step.values.clone());
        let mut read = transfer(values.collect()).into_iter();
        let of_step = |step: &&Self| {
            let terms = step.batches.iter().map(|batch| batch.numbers.term_count());
            let terms: usize = terms.sum();
            let mut next = |count: usize| -> Vec<f64> { read.by_ref().take(count).collect() };
            let (terms, decided) = (next(terms), next(2));
            ReadStep {
                of_scale: next(step.values.dims()[0] - terms.len() - decided.len()),
                terms,
                gradient_norm: decided[0].sqrt(),
                is_made: decided[1] > 0.5,
            }
        };
        steps.iter().map(of_step).collect()
    }

    /// The numbers of the batches, each a `share` of the step with this number.
    ///
    /// # Errors
    /// As [`Figures::add`].
    pub(super) fn figures(
        &self,
        read: &ReadStep,
        share: f64,
        step: usize,
    ) -> Result<Figures, Error> {
        let mut figures = Figures::default();
        let (mut terms, mut of_scale) = (read.terms.iter().copied(), read.of_scale.iter().copied());
        for batch in &self.batches {
            let numbers = batch.numbers.numbers(&mut terms, &mut of_scale);
            figures.add(batch, &numbers, share, step)?;
        }
        Ok(figures)
    }
}

/// The numbers of a step that the device has decided about.
pub(super) struct ReadStep {
    terms: Vec<f64>,
    of_scale: Vec<f64>,
    gradient_norm: f64,
    pub(super) is_made: bool,
}

impl ReadStep {
    pub(super) fn outcome(&self) -> StepOutcome {
        if self.is_made {
            StepOutcome::Done {
                gradient_norm: self.gradient_norm,
            }
        } else {
            StepOutcome::Skipped
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    /// A step of three batches: video, known depth, from which no scale ratio is taken, and video again.
    fn step(at: f32, made: bool) -> UnreadStep {
        let device = Device::flex().autodiff();
        let value = |number: f32| Tensor::<1>::from_data([number], &device);
        let video = |measured: f32| {
            let mut numbers = Unread::default();
            numbers.note(|terms| &mut terms.valid_share, value(0.5));
            numbers.note(|terms| &mut terms.total, value(at));
            numbers.note_displacements([value(measured), value(2.0)]);
            numbers
        };
        let mut depth = Unread::default();
        depth.note(|terms| &mut terms.depth, value(4.0 * at));
        depth.note_bias(value(0.25));
        let batches = [(video(8.0), true), (depth, false), (video(12.0), true)];
        let mut batches = batches.map(|(numbers, is_video)| UnreadBatch {
            numbers,
            names: Vec::new(),
            is_video,
            gives_scale: is_video,
        });
        let terms = batches.iter_mut().flat_map(|b| b.numbers.take_terms());
        let losses = Tensor::cat(terms.collect(), 0);
        let squares = value(at * at).inner();
        let is_made = value(f32::from(u8::from(made))).inner().greater_elem(0.5);
        UnreadStep::new(batches.into(), [losses, squares], is_made)
    }

    /// Two steps that are read together: each of their batches gets its own numbers.
    #[test]
    fn each_batch_of_several_steps_gets_its_own_numbers() {
        let steps = [step(3.0, true), step(f32::INFINITY, false), step(5.0, true)];
        let read = UnreadStep::read(&[&steps[0], &steps[1], &steps[2]]);
        for (index, at) in [(0, 3.0), (2, 5.0)] {
            let figures = steps[index].figures(&read[index], 0.25, 1).unwrap();
            assert_eq!((figures.losses.total, figures.losses.depth), (at / 2.0, at));
            assert_eq!(figures.monitors.valid, [0.5, 0.5]);
            assert_eq!(figures.monitors.ratio, [4.0, 6.0]);
            let gradient_norm = at;
            assert_eq!(read[index].outcome(), StepOutcome::Done { gradient_norm });
        }
        assert_eq!(read[1].outcome(), StepOutcome::Skipped);
        let failed = steps[1].figures(&read[1], 0.25, 7);
        assert!(matches!(
            failed.map(|_| ()),
            Err(Error::NotFinite {
                step: 7,
                term: "total",
                ..
            })
        ));
    }
}
