//! Memory that a thread keeps from task to task, so that an image needs no allocation.

use std::cell::RefCell;

use crate::aligned::Aligned;
#[cfg(target_arch = "x86_64")]
use crate::element::Bf16;
use crate::element::Plain;
use crate::tile::Pixel;

/// Buffers that only grow; each task overwrites the part that it uses.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) first: GrowingBuffer<f32>,
    pub(crate) second: GrowingBuffer<f32>,
    #[cfg(target_arch = "x86_64")]
    pub(crate) halves: GrowingBuffer<Bf16>,
    pub(crate) pixels: Vec<Pixel>,
}

/// Values, as many as the largest request so far.
pub(crate) struct GrowingBuffer<T>(Aligned<T>);

impl<T: Plain> Default for GrowingBuffer<T> {
    fn default() -> Self {
        Self(Aligned::zeros(0))
    }
}

impl<T: Plain> GrowingBuffer<T> {
    /// The first `len` values, with arbitrary content.
    pub(crate) fn take(&mut self, len: usize) -> &mut [T] {
        if self.0.len() < len {
            self.0 = Aligned::zeros(len);
        }
        &mut self.0[..len]
    }
}

/// Lends the thread's buffers to a task. Tasks do not start other tasks, so nobody else uses them.
pub(crate) fn with_scratch<R>(task: impl FnOnce(&mut Scratch) -> R) -> R {
    thread_local! {
        static SCRATCH: RefCell<Scratch> = RefCell::default();
    }
    SCRATCH.with_borrow_mut(task)
}
