//! Numbers of batches that stay on the device until all are read at once.

use crate::LossTerms;
use burn::tensor::Tensor;

/// Where a term stands among the others.
pub(crate) type TermField = fn(&mut LossTerms) -> &mut f64;

/// The terms of a batch's loss, and what says how metric its scale is, on the device.
#[derive(Default)]
pub(crate) struct Unread {
    fields: Vec<TermField>,
    scale: Option<Scale>,
    /// Those of the fields, then those of the scale, one value each.
    values: Vec<Tensor<1>>,
}

/// By what a scale is measured.
#[derive(Clone, Copy)]
enum Scale {
    /// Displacement by the vehicle's speed over displacement by PoseNet.
    Displacement,
    /// ln of predicted over true depth.
    Bias,
}

/// What was read of a batch.
pub(crate) struct BatchNumbers {
    pub(crate) terms: LossTerms,
    /// 1 when the scale is metric; NaN where nothing says it.
    pub(crate) scale_ratio: f64,
}

impl Unread {
    /// Keeps a term, one value. All terms come before what says the scale.
    pub(crate) fn note(&mut self, field: TermField, value: Tensor<1>) {
        debug_assert!(self.scale.is_none(), "the scale's numbers are the last");
        self.fields.push(field);
        self.keep(value);
    }

    /// Keeps a batch's displacements, measured and predicted, each summed.
    pub(crate) fn note_displacements(&mut self, displacements: [Tensor<1>; 2]) {
        self.scale = Some(Scale::Displacement);
        displacements.into_iter().for_each(|value| self.keep(value));
    }

    /// Keeps the mean of ln(predicted / true depth).
    pub(crate) fn note_bias(&mut self, bias: Tensor<1>) {
        self.scale = Some(Scale::Bias);
        self.keep(bias);
    }

    fn keep(&mut self, value: Tensor<1>) {
        self.values.push(value.detach().inner());
    }

    /// Reads one batch's numbers.
    pub(crate) fn read(self) -> BatchNumbers {
        let numbers = transfer(self.values.clone());
        self.numbers(&mut numbers.into_iter())
    }

    /// The batch's own among numbers that were read, in the order in which they were kept.
    fn numbers(&self, read: &mut impl Iterator<Item = f64>) -> BatchNumbers {
        let mut terms = LossTerms::default();
        for (field, value) in self.fields.iter().zip(read.by_ref()) {
            *field(&mut terms) = value;
        }
        let mut next = || read.next().unwrap_or(f64::NAN);
        let scale_ratio = match self.scale {
            None => f64::NAN,
            Some(Scale::Displacement) => {
                let (measured, predicted) = (next(), next());
                measured / predicted.max(1e-9)
            }
            Some(Scale::Bias) => (-next()).exp(),
        };
        BatchNumbers { terms, scale_ratio }
    }
}

/// Reads the numbers of batches, and one value more if it is there, in one transfer from the device.
pub(crate) fn read_at_once(
    batches: &[&Unread],
    more: Option<Tensor<1>>,
) -> (Vec<BatchNumbers>, Option<f64>) {
    let values = batches.iter().flat_map(|batch| batch.values.clone());
    let mut read = transfer(values.chain(more).collect()).into_iter();
    let numbers = batches.iter().map(|batch| batch.numbers(&mut read));
    let numbers = numbers.collect();
    (numbers, read.next())
}

#[cfg(test)]
thread_local! {
    /// Transfers of this thread.
    pub(crate) static TRANSFERS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

fn transfer(values: Vec<Tensor<1>>) -> Vec<f64> {
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

    /// Read together or alone, each batch has its own numbers.
    #[test]
    fn numbers_go_where_they_belong() {
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
        let more = value(9.0).inner();
        let (all, more) = read_at_once(&[&video(), &plain, &depth()], Some(more));
        assert_eq!(TRANSFERS.get() - before, 1);
        check(&all[0], &all[2]);
        assert_eq!((all[1].terms.flow, more), (8.0, Some(9.0)));
        assert!(all[1].scale_ratio.is_nan());
        let (none, more) = read_at_once(&[], None);
        assert!(none.is_empty() && more.is_none());
        assert_eq!(TRANSFERS.get() - before, 1, "nothing to read");
    }
}
