//! Destinations of results, initialised or not.

use std::mem::MaybeUninit;

/// A destination of results: floats, or uninitialised memory for floats. Clearing memory that is overwritten anyway
/// took a fourteenth of a training step.
///
/// A kernel writes every value, and reads none that it has not written.
///
/// # Safety
/// It must be laid out as an `f32`, and any `f32` must be one.
pub unsafe trait Slot: Copy + Send + Sync + sealed::Sealed {}

// SAFETY: it is one.
unsafe impl Slot for f32 {}
// SAFETY: laid out as what it may hold, which may be any.
unsafe impl Slot for MaybeUninit<f32> {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for std::mem::MaybeUninit<f32> {}
}

/// The slots as room that nothing is known of; only values are written to it.
pub(crate) fn room<T: Slot>(out: &mut [T]) -> &mut [MaybeUninit<f32>] {
    // SAFETY: both are laid out as an `f32` (the promise of `Slot`). The kernels write values and nothing else, so that
    // what were floats before are floats after.
    unsafe { std::slice::from_raw_parts_mut(out.as_mut_ptr().cast(), out.len()) }
}

/// Writes as many values as there is room for, and gives them back as floats.
///
/// # Panics
/// When there are not as many.
pub(crate) fn filled(
    room: &mut [MaybeUninit<f32>],
    values: impl ExactSizeIterator<Item = f32>,
) -> &mut [f32] {
    assert_eq!(room.len(), values.len(), "a value for every place");
    for (to, value) in room.iter_mut().zip(values) {
        to.write(value);
    }
    // SAFETY: all were written: this crate's iterators over slices are as long as they say.
    unsafe { room.assume_init_mut() }
}
