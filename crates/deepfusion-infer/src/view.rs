//! Views of values: images with interleaved channels (H×W×C) in one block of memory.

use std::marker::PhantomData;

/// An image's place in the arena: channel c of pixel (x, y) is at `offset + y·row + x·pitch + c`.
///
/// The image has a border of `border` pixels on every side, including before and after each row, so that a kernel may reach over the edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct View {
    /// Offset of pixel (0, 0), in elements.
    pub(crate) offset: usize,
    /// Elements from one row to the next.
    pub(crate) row: usize,
    /// Elements from one pixel to the next.
    pub(crate) pitch: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Number of channels, including padding to whole vectors.
    pub(crate) channels: usize,
    /// Width of the border on every side, in pixels.
    pub(crate) border: usize,
    /// Whether it is a result: one channel, stored as f32 whatever the element type, which no operation reads.
    pub(crate) result: bool,
}

impl View {
    pub(crate) fn at(&self, x: usize, y: usize) -> usize {
        self.offset + y * self.row + x * self.pitch
    }

    /// Offset of pixel (−border, −border), in elements.
    pub(crate) fn start(&self) -> usize {
        self.offset - self.border * (self.row + self.pitch)
    }

    /// A view in which every pixel is the same.
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

/// The arena, shared by the threads of a step: each writes where no other reads or writes.
///
/// It borrows the arena during its lifetime. Every access is checked to be within the arena. Callers of the unsafe functions must ensure
/// that accesses of different threads do not collide.
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

// SAFETY: it is a `&mut [T]` that is accessed in parts; callers of its unsafe functions keep reads and writes apart.
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

    /// A pointer to `len` elements from `offset` on, all of them in the arena.
    ///
    /// # Panics
    /// If they are not all in the arena.
    #[inline(always)]
    pub(crate) fn at(self, offset: usize, len: usize) -> *mut T {
        let inside = offset <= self.len && len <= self.len - offset;
        assert!(inside, "a view beyond the arena");
        // SAFETY: within the arena, as was just checked.
        unsafe { self.first.add(offset) }
    }

    /// `len` elements from `offset` on.
    ///
    /// # Safety
    /// Nobody may write them during the lifetime of the slice.
    ///
    /// # Panics
    /// As for [`Self::at`].
    #[inline(always)]
    pub(crate) unsafe fn read(self, offset: usize, len: usize) -> &'a [T] {
        // SAFETY: they are in the arena, which is borrowed for `'a`; nobody writes them (guaranteed by the caller).
        unsafe { std::slice::from_raw_parts(self.at(offset, len), len) }
    }

    /// Like [`Self::read`], for writing.
    ///
    /// # Safety
    /// Nobody else may read or write them during the lifetime of the slice.
    ///
    /// # Panics
    /// As for [`Self::at`].
    #[inline(always)]
    pub(crate) unsafe fn write(self, offset: usize, len: usize) -> &'a mut [T] {
        // SAFETY: they are in the arena, which is borrowed for `'a`; nobody else uses them (guaranteed by the caller).
        unsafe { std::slice::from_raw_parts_mut(self.at(offset, len), len) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accesses_beyond_the_arena_panic() {
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
