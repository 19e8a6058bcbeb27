//! Reusable buffers for decompressed chunks: a fresh one costs a page fault per 4 KiB.

use std::ops::Deref;
use std::sync::{Arc, Mutex};

/// Buffers that are not in use.
pub(crate) struct Pool {
    free: Mutex<Vec<Vec<u8>>>,
    /// Most buffers that are kept.
    most: usize,
}

impl Pool {
    pub(crate) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self {
            free: Mutex::default(),
            most,
        })
    }

    /// An empty buffer.
    pub(crate) fn take(self: &Arc<Self>) -> Buffer {
        // A thread that panicked while it held the lock cannot have left a half-changed list.
        let mut free = self
            .free
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        Buffer {
            bytes: free.pop().unwrap_or_default(),
            filled: 0,
            pool: Arc::clone(self),
        }
    }
}

/// A buffer that returns to its pool. After its valid bytes it keeps those of its last use, so that it need not be
/// zeroed again.
pub(crate) struct Buffer {
    bytes: Vec<u8>,
    filled: usize,
    pool: Arc<Pool>,
}

impl Buffer {
    /// The valid bytes, and `room` arbitrary bytes after them.
    pub(crate) fn split(&mut self, room: usize) -> (&[u8], &mut [u8]) {
        let needed = self.filled + room;
        if self.bytes.len() < needed {
            self.bytes.resize(needed, 0);
        }
        let (filled, rest) = self.bytes.split_at_mut(self.filled);
        (filled, &mut rest[..room])
    }

    /// Counts bytes that were written after the valid ones as valid.
    pub(crate) fn advance(&mut self, count: usize) {
        self.filled = (self.filled + count).min(self.bytes.len());
    }

    /// Appends bytes.
    pub(crate) fn extend(&mut self, bytes: &[u8]) {
        self.split(bytes.len()).1.copy_from_slice(bytes);
        self.advance(bytes.len());
    }
}

impl Deref for Buffer {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes[..self.filled]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let bytes = std::mem::take(&mut self.bytes);
        let mut free = self
            .pool
            .free
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        if free.len() < self.pool.most {
            free.push(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pool_keeps_a_limited_number_of_empty_buffers() {
        let pool = Pool::new(1);
        let (mut one, two) = (pool.take(), pool.take());
        one.extend(&[1; 1000]);
        assert_eq!(one[..], [1; 1000]);
        drop(one);
        drop(two);
        let mut again = pool.take();
        assert!(again.is_empty());
        assert_eq!(again.split(500).1, [1; 500], "the first one");
        assert_eq!(pool.take().split(3).1, [0; 3], "a new one");
    }
}
