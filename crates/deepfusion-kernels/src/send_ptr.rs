/// A mutable buffer that several tasks write to at disjoint places.
///
/// Rayon's closures may not share `&mut [T]`; where the parts a task writes are not one contiguous
/// chunk (a tile of columns of every row), the split cannot be said with slices.
#[derive(Clone, Copy)]
pub(crate) struct SharedMut<T> {
    pointer: *mut T,
    len: usize,
}

// SAFETY: the users of `SharedMut` only hand disjoint ranges to different tasks; each use says why.
unsafe impl<T: Send> Send for SharedMut<T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for SharedMut<T> {}

impl<T> SharedMut<T> {
    pub(crate) fn new(slice: &mut [T]) -> Self {
        Self {
            pointer: slice.as_mut_ptr(),
            len: slice.len(),
        }
    }

    /// The range `start..start + len`.
    ///
    /// # Safety
    /// No two live slices from this buffer may overlap.
    #[allow(clippy::mut_from_ref)]
    pub(crate) unsafe fn slice(&self, start: usize, len: usize) -> &mut [T] {
        assert!(start + len <= self.len, "range outside the buffer");
        // SAFETY: in bounds by the assertion, not aliased by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.pointer.add(start), len) }
    }
}
