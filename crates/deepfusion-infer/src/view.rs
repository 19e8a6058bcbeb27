//! Views of values: images with interleaved channels (H×W×C), inside one block of memory.

use std::marker::PhantomData;

/// An image's place in the arena: pixel (x, y), channel c lies at `offset + y·row + x·pitch + c`.
///
/// A border of `border` pixels lies around it, before and after each row too, so that a kernel may reach
/// over the edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct View {
    /// Of pixel (0, 0), in elements.
    pub(crate) offset: usize,
    /// Elements from a row to the next.
    pub(crate) row: usize,
    /// Elements from a pixel to the next.
    pub(crate) pitch: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Channels, those that only fill up a vector included.
    pub(crate) channels: usize,
    /// Pixels around the image on every side.
    pub(crate) border: usize,
    /// Whether it is one channel stored as f32 whatever the elements are: a result that nothing reads.
    pub(crate) result: bool,
}

impl View {
    pub(crate) fn at(&self, x: usize, y: usize) -> usize {
        self.offset + y * self.row + x * self.pitch
    }

    /// Of pixel (−border, −border).
    pub(crate) fn start(&self) -> usize {
        self.offset - self.border * (self.row + self.pitch)
    }

    /// The same pixel wherever one looks.
    pub(crate) fn everywhere(self) -> Self {
        Self {
            row: 0,
            pitch: 0,
            ..self
        }
    }

    pub(crate) fn pixels(&self) -> usize {
        self.width * self.height
    }
}

/// The arena as the threads of a step share it: each writes where no other reads or writes.
///
/// It borrows the arena for as long as it lives. Every access is checked to lie in the arena; that accesses of
/// different threads do not collide is what the unsafe ones ask of their callers.
pub(crate) struct Shared<'a, T> {
    first: *mut T,
    len: usize,
    arena: PhantomData<&'a mut [T]>,
}

impl<T> Clone for Shared<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shared<'_, T> {}

// SAFETY: it is a `&mut [T]` handed out in parts; what is read and written through it is for the callers of its unsafe
// functions to keep apart.
unsafe impl<T: Send + Sync> Send for Shared<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Shared<'_, T> {}

impl<'a, T> Shared<'a, T> {
    pub(crate) fn new(arena: &'a mut [T]) -> Self {
        Self {
            first: arena.as_mut_ptr(),
            len: arena.len(),
            arena: PhantomData,
        }
    }

    /// A pointer to `len` elements from `offset` on, all of the arena.
    ///
    /// # Panics
    /// When they are not.
    #[inline(always)]
    pub(crate) fn at(self, offset: usize, len: usize) -> *mut T {
        let inside = offset <= self.len && len <= self.len - offset;
        assert!(inside, "a view beyond the arena");
        // SAFETY: no farther than the arena's end, as was just checked.
        unsafe { self.first.add(offset) }
    }

    /// `len` elements from `offset` on.
    ///
    /// # Safety
    /// Nobody may write them while the slice lives.
    ///
    /// # Panics
    /// As [`Self::at`].
    #[inline(always)]
    pub(crate) unsafe fn read(self, offset: usize, len: usize) -> &'a [T] {
        // SAFETY: they lie in the arena, which is borrowed for `'a`; that nobody writes them is the caller's promise.
        unsafe { std::slice::from_raw_parts(self.at(offset, len), len) }
    }

    /// The same to be written.
    ///
    /// # Safety
    /// Nobody else may read or write them while the slice lives.
    ///
    /// # Panics
    /// As [`Self::at`].
    #[inline(always)]
    pub(crate) unsafe fn write(self, offset: usize, len: usize) -> &'a mut [T] {
        // SAFETY: they lie in the arena, which is borrowed for `'a`; that nobody else uses them is the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.at(offset, len), len) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beyond_the_arena_is_not_handed_out() {
        let mut numbers = [1.0_f32, 2.0, 3.0];
        let arena = Shared::new(&mut numbers);
        // SAFETY: one thread, one slice at a time.
        unsafe {
            arena.write(1, 2)[1] = 5.0;
            assert_eq!(arena.read(0, 3), [1.0, 2.0, 5.0]);
        }
        assert_eq!(arena.at(3, 0).addr(), arena.at(0, 3).addr() + 12);
        for (offset, len) in [(0, 4), (3, 1), (4, 0), (usize::MAX, 2), (2, usize::MAX)] {
            let beyond = std::panic::AssertUnwindSafe(|| arena.at(offset, len));
            assert!(std::panic::catch_unwind(beyond).is_err(), "{offset} {len}");
        }
    }
}
