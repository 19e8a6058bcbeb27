//! Where values lie: images with their channels together (H×W×C), inside one block of memory.

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

/// A pointer that threads share; each writes where no other reads or writes.
#[derive(Clone, Copy)]
pub(crate) struct Shared<T>(pub(crate) *mut T);

// SAFETY: whoever dereferences it answers for what is read and written.
unsafe impl<T> Send for Shared<T> {}
// SAFETY: as above.
unsafe impl<T> Sync for Shared<T> {}

impl<T> Shared<T> {
    /// # Safety
    /// `offset` must lie in the block.
    #[inline(always)]
    pub(crate) unsafe fn at(self, offset: usize) -> *mut T {
        // SAFETY: the caller's promise.
        unsafe { self.0.add(offset) }
    }
}
