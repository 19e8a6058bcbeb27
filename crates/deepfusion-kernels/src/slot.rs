//! Destinations of results, initialised or not.

use std::mem::MaybeUninit;

/// A destination of results: floats, or uninitialised memory for floats. Clearing memory that is overwritten anyway took a fourteenth of a
/// training step.
///
/// A kernel writes all values, and reads only those that it has written.
///
/// # Safety
/// It must have the layout of an `f32`, and any `f32` must be a valid value.
pub unsafe trait Slot: Copy + Send + Sync + sealed::Sealed {}

// SAFETY: it is an `f32`.
unsafe impl Slot for f32 {}
// SAFETY: it has the layout of the `f32` that it may contain, and any is valid.
unsafe impl Slot for MaybeUninit<f32> {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for std::mem::MaybeUninit<f32> {}
}

/// The slots as uninitialised memory; only values may be written to it.
pub(crate) fn room<T: Slot>(out: &mut [T]) -> &mut [MaybeUninit<f32>] {
    // SAFETY: both have the layout of an `f32` (the contract of `Slot`). The kernels only write values, so what was a float before is still
    // one.
    unsafe { std::slice::from_raw_parts_mut(out.as_mut_ptr().cast(), out.len()) }
}

/// Writes the values, as many as there are places, and returns them as floats.
///
/// # Panics
/// If the numbers of values and places differ.
pub(crate) fn filled(
    room: &mut [MaybeUninit<f32>],
    values: impl ExactSizeIterator<Item = f32>,
) -> &mut [f32] {
    assert_eq!(room.len(), values.len(), "a value for every place");
    for (to, value) in room.iter_mut().zip(values) {
        to.write(value);
    }
    // SAFETY: all were written: this crate's iterators over slices yield exactly `len()` items.
    unsafe { room.assume_init_mut() }
}
