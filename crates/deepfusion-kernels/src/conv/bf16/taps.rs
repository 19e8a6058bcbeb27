//! The product over taps of channel pairs.

use super::{COLUMNS, ROWS, Unit};

/// `out[m][q] = Σ_step Σ_p weights[m][step, p] · source[offsets[step] + p·plane_len + q]`, both factors pairs of bf16.
pub(in super::super) struct TapPairs<'a> {
    /// For every [`ROWS`] rows and each step: a tile of rows × `pairs` ([`super::pack_weights`]).
    pub(in super::super) weights: &'a [u32],
    /// Offset of the first pair of each step's tap.
    pub(in super::super) offsets: &'a [usize],
    /// Number of pairs in a step, at most [`ROWS`].
    pub(in super::super) pairs: usize,
    /// Distance from one pair to the next.
    pub(in super::super) plane_len: usize,
    pub(in super::super) source: &'a [u32],
    /// Number of columns, a multiple of [`COLUMNS`].
    pub(in super::super) columns: usize,
    /// `rows` × `columns`, overwritten.
    pub(in super::super) out: &'a mut [f32],
    /// Number of rows, a multiple of [`ROWS`].
    pub(in super::super) rows: usize,
}

impl TapPairs<'_> {
    pub(in super::super) fn run(self, unit: Unit) {
        assert_eq!(self.columns % COLUMNS, 0, "columns are whole blocks");
        assert_eq!(self.rows % ROWS, 0, "rows are whole tiles");
        assert!((1..=ROWS).contains(&self.pairs), "pairs of a step");
        assert!(!self.offsets.is_empty(), "a convolution has taps");
        assert_eq!(self.out.len(), self.rows * self.columns, "output length");
        assert_eq!(
            self.weights.len(),
            self.rows * self.offsets.len() * self.pairs,
            "weights"
        );
        let last = self
            .offsets
            .iter()
            .max()
            .map_or(0, |first| first + (self.pairs - 1) * self.plane_len);
        assert!(self.source.len() >= last + self.columns, "source length");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: all bounds were just checked, and the processor has the `Unit`.
        unsafe {
            match unit {
                Unit::Matrix => super::matrix::taps(self),
                Unit::Dot => super::dot::taps(self),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        unreachable!("no {unit:?} on this processor");
    }
}
