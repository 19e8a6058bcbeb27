use std::marker::PhantomData;

/// A mutable buffer that several tasks write to at disjoint places, for the duration of the borrow.
///
/// Rayon's closures cannot share `&mut [T]`. If a task's parts are not one contiguous chunk (a tile of columns of every row), slices cannot
/// express the split.
pub(crate) struct SharedMut<'a, T> {
    pointer: *mut T,
    len: usize,
    buffer: PhantomData<&'a mut [T]>,
}

impl<T> Clone for SharedMut<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for SharedMut<'_, T> {}

// SAFETY: it is a `&mut [T]` that is accessed in parts; each use guarantees that no two of them overlap.
unsafe impl<T: Send> Send for SharedMut<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for SharedMut<'_, T> {}

impl<'a, T> SharedMut<'a, T> {
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self {
            pointer: slice.as_mut_ptr(),
            len: slice.len(),
            buffer: PhantomData,
        }
    }

    /// The range `start..start + len`.
    ///
    /// # Safety
    /// No two live slices from this buffer may overlap.
    ///
    /// # Panics
    /// If it extends beyond the buffer.
    pub(crate) unsafe fn slice(&self, start: usize, len: usize) -> &'a mut [T] {
        let inside = start <= self.len && len <= self.len - start;
        assert!(inside, "range outside the buffer");
        // SAFETY: in bounds by the assertion, of a buffer that is borrowed for `'a`; not aliased (guaranteed by the caller).
        unsafe { std::slice::from_raw_parts_mut(self.pointer.add(start), len) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_outside_the_buffer_are_refused() {
        let mut buffer = [1, 2, 3];
        let shared = SharedMut::new(&mut buffer);
        // SAFETY: one at a time.
        assert_eq!(unsafe { shared.slice(1, 2) }, [2, 3]);
        for (start, len) in [(0, 4), (4, 0), (usize::MAX, 2), (2, usize::MAX)] {
            // SAFETY: one at a time.
            let outside =
                std::panic::AssertUnwindSafe(|| unsafe { shared.slice(start, len) }.len());
            assert!(std::panic::catch_unwind(outside).is_err(), "{start} {len}");
        }
    }
}
