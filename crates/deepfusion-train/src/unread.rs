//! Numbers of batches that stay on the device until they are all read in one transfer.

use crate::LossTerms;
use burn::tensor::Tensor;

/// The field of a term.
pub(crate) type TermField = fn(&mut LossTerms) -> &mut f64;

/// The terms of a batch's loss and the values of its scale ratio, on the device.
#[derive(Default)]
pub(crate) struct Unread {
    fields: Vec<TermField>,
    scale: Option<Scale>,
    /// The terms of `fields`, one value each.
    terms: Vec<Tensor<1>>,
    /// The values that the scale ratio is computed from, one value each.
    of_scale: Vec<Tensor<1>>,
}

/// How the scale ratio is measured.
#[derive(Clone, Copy)]
enum Scale {
    /// Displacement by the vehicle's speed over displacement by PoseNet.
    Displacement,
    /// ln of predicted over true depth.
    Bias,
}

/// The numbers that were read of a batch.
pub(crate) struct BatchNumbers {
    pub(crate) terms: LossTerms,
    /// 1 when the scale is metric; NaN if it is not known.
    pub(crate) scale_ratio: f64,
}

impl Unread {
    /// Keeps a term, one value.
    pub(crate) fn note(&mut self, field: TermField, value: Tensor<1>) {
        self.fields.push(field);
        self.terms.push(value.detach().inner());
    }

    /// Keeps a batch's displacements, measured and predicted, each summed.
    pub(crate) fn note_displacements(&mut self, displacements: [Tensor<1>; 2]) {
        self.keep_scale(Scale::Displacement, displacements.into());
    }

    /// Keeps the mean of ln(predicted / true depth).
    pub(crate) fn note_bias(&mut self, bias: Tensor<1>) {
        self.keep_scale(Scale::Bias, vec![bias]);
    }

    fn keep_scale(&mut self, scale: Scale, values: Vec<Tensor<1>>) {
        self.scale = Some(scale);
        let values = values.into_iter().map(|value| value.detach().inner());
        self.of_scale = values.collect();
    }

    /// Moves the terms' values out. [`Self::numbers`] can still assign them to their fields.
    pub(crate) fn take_terms(&mut self) -> Vec<Tensor<1>> {
        std::mem::take(&mut self.terms)
    }

    /// Moves the values of the scale ratio out.
    pub(crate) fn take_scale(&mut self) -> Vec<Tensor<1>> {
        std::mem::take(&mut self.of_scale)
    }

    /// Number of terms.
    pub(crate) fn term_count(&self) -> usize {
        self.fields.len()
    }

    /// Reads one batch's numbers.
    pub(crate) fn read(mut self) -> BatchNumbers {
        read_at_once(&mut [&mut self]).remove(0)
    }

    /// Takes the batch's own numbers from those that were read: the terms and the values of the scale ratio, each in the order of the
    /// batches.
    pub(crate) fn numbers(
        &self,
        terms: &mut impl Iterator<Item = f64>,
        of_scale: &mut impl Iterator<Item = f64>,
    ) -> BatchNumbers {
        let mut own = LossTerms::default();
        for (field, value) in self.fields.iter().zip(terms) {
            *field(&mut own) = value;
        }
        let mut next = || of_scale.next().unwrap_or(f64::NAN);
        let scale_ratio = match self.scale {
            None => f64::NAN,
            Some(Scale::Displacement) => {
                let (measured, predicted) = (next(), next());
                measured / predicted.max(1e-9)
            }
            Some(Scale::Bias) => (-next()).exp(),
        };
        BatchNumbers {
            terms: own,
            scale_ratio,
        }
    }
}

/// Reads the numbers of batches in one transfer from the device.
pub(crate) fn read_at_once(batches: &mut [&mut Unread]) -> Vec<BatchNumbers> {
    let mut values = Vec::new();
    for batch in &mut *batches {
        values.extend(batch.take_terms());
    }
    let terms = values.len();
    for batch in &mut *batches {
        values.extend(batch.take_scale());
    }
    let read = transfer(values);
    let (terms, of_scale) = read.split_at(terms);
    let (mut terms, mut of_scale) = (terms.iter().copied(), of_scale.iter().copied());
    let numbers = batches.iter();
    numbers
        .map(|batch| batch.numbers(&mut terms, &mut of_scale))
        .collect()
}

#[cfg(test)]
thread_local! {
    /// Number of this thread's transfers.
    pub(crate) static TRANSFERS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// Reads all values, in one transfer from their device.
pub(crate) fn transfer(values: Vec<Tensor<1>>) -> Vec<f64> {
    if values.is_empty() {
        return Vec::new();
    }
    #[cfg(test)]
    TRANSFERS.set(TRANSFERS.get() + 1);
    let data = Tensor::cat(values, 0).into_data();
    data.iter::<f32>().map(f64::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    /// Read together or alone, each batch gets its own numbers.
    #[test]
    fn each_batch_gets_its_own_numbers() {
        let device = Device::flex().autodiff();
        let value = |v: f32| Tensor::<1>::from_data([v], &device);
        let video = || {
            let mut unread = Unread::default();
            unread.note(|terms| &mut terms.speed, value(0.5));
            unread.note(|terms| &mut terms.total, value(2.0));
            unread.note_displacements([value(3.0), value(4.0)]);
            unread
        };
        let depth = || {
            let mut unread = Unread::default();
            unread.note(|terms| &mut terms.depth, value(0.25));
            unread.note_bias(value(0.0));
            unread
        };
        let mut plain = Unread::default();
        plain.note(|terms| &mut terms.flow, value(8.0));
        let check = |of_video: &BatchNumbers, of_depth: &BatchNumbers| {
            assert_eq!((of_video.terms.speed, of_video.terms.total), (0.5, 2.0));
            assert_eq!(of_video.scale_ratio, 0.75);
            assert_eq!((of_depth.terms.depth, of_depth.terms.total), (0.25, 0.0));
            assert_eq!(of_depth.scale_ratio, 1.0);
        };
        check(&video().read(), &depth().read());
        let before = TRANSFERS.get();
        let all = read_at_once(&mut [&mut video(), &mut plain, &mut depth()]);
        assert_eq!(TRANSFERS.get() - before, 1);
        check(&all[0], &all[2]);
        assert_eq!(all[1].terms.flow, 8.0);
        assert!(all[1].scale_ratio.is_nan());
        assert!(read_at_once(&mut []).is_empty());
        assert_eq!(TRANSFERS.get() - before, 1, "nothing to read");
    }
}
