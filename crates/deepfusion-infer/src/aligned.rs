//! Memory aligned to cache lines, so that a vector or a row of a tile is in one line, not two.

use std::ops::{Deref, DerefMut};

use crate::element::Plain;

/// A cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

/// A fixed number of values, the first at a multiple of 64 bytes.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    lines: Vec<Line>,
    len: usize,
    kind: std::marker::PhantomData<T>,
}

impl<T: Plain> Aligned<T> {
    /// Zeros; `None` if there is not enough memory.
    pub(crate) fn try_zeros(len: usize) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        let count = bytes.div_ceil(size_of::<Line>());
        let mut lines = Vec::new();
        lines.try_reserve_exact(count).ok()?;
        lines.resize(count, Line([0; 64]));
        Some(Self {
            lines,
            len,
            kind: std::marker::PhantomData,
        })
    }

    /// Zeros, for sizes that follow from data already in memory.
    ///
    /// # Panics
    /// If there is not enough memory.
    #[expect(
        clippy::expect_used,
        reason = "like `vec!`: fails only if there is no memory for data as large as a loaded network"
    )]
    pub(crate) fn zeros(len: usize) -> Self {
        Self::try_zeros(len).expect("memory for a network's weights")
    }

    /// An aligned copy of the values.
    pub(crate) fn from_slice(values: &[T]) -> Self {
        let mut aligned = Self::zeros(values.len());
        aligned.copy_from_slice(values);
        aligned
    }
}

impl<T: Plain> Deref for Aligned<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        // SAFETY: the lines have room for `len` values, at a multiple of their alignment, and any bits are a valid value (the contract of
        // `Plain`).
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

impl<T: Plain> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_any_memory_are_refused() {
        assert!(Aligned::<f32>::try_zeros(usize::MAX / 4 + 1).is_none());
        assert!(Aligned::<f32>::try_zeros(usize::MAX / 4).is_none());
        let some = Aligned::<f32>::try_zeros(17).unwrap();
        assert_eq!((some.len(), some.as_ptr().addr() % 64), (17, 0));
        assert!(some.iter().all(|v| *v == 0.0));
    }
}
