//! Memory that a thread keeps from task to task, so that an image costs no allocation.

use std::cell::RefCell;

use crate::aligned::Aligned;
use crate::tile::Pixel;

/// Buffers that only grow; each task overwrites what it takes.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) first: GrowingBuffer,
    pub(crate) second: GrowingBuffer,
    pub(crate) pixels: Vec<Pixel>,
}

/// Numbers as many as were ever asked for at once.
pub(crate) struct GrowingBuffer(Aligned<f32>);

impl Default for GrowingBuffer {
    fn default() -> Self {
        Self(Aligned::zeros(0))
    }
}

impl GrowingBuffer {
    /// The first `len` numbers, whatever they are.
    pub(crate) fn take(&mut self, len: usize) -> &mut [f32] {
        if self.0.len() < len {
            self.0 = Aligned::zeros(len);
        }
        &mut self.0[..len]
    }
}

/// Lends the thread's buffers to a task. Tasks do not start others, so nobody else has them.
pub(crate) fn with_scratch<R>(task: impl FnOnce(&mut Scratch) -> R) -> R {
    thread_local! {
        static SCRATCH: RefCell<Scratch> = RefCell::default();
    }
    SCRATCH.with_borrow_mut(task)
}
