//! A bounded cache of built objects, shared by threads.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Keeps the `capacity` most recently used objects. The lock is not held during a build: threads that want other objects proceed, and those
/// that want the same one wait for it.
pub(super) struct Cache<T> {
    capacity: usize,
    entries: Mutex<Entries<T>>,
}

/// The object, once it is built.
type Cell<T> = Arc<OnceLock<Arc<T>>>;

struct Entries<T> {
    clock: u64,
    /// For each key the time of the last use, and the object.
    of: HashMap<u64, (u64, Cell<T>)>,
}

impl<T> Cache<T> {
    /// A cache for at least one object.
    pub(super) fn new(capacity: usize) -> Self {
        Self {
            capacity: capacity.max(1),
            entries: Mutex::new(Entries {
                clock: 0,
                of: HashMap::new(),
            }),
        }
    }

    /// The object of this key, built if necessary.
    pub(super) fn get(&self, key: u64, build: impl FnOnce() -> T) -> Arc<T> {
        let cell = {
            // No code panics while the map is half changed, so a poisoned lock is safe to use.
            let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
            entries.clock += 1;
            let now = entries.clock;
            if !entries.of.contains_key(&key) && entries.of.len() >= self.capacity {
                let oldest = entries.of.iter().min_by_key(|(_, entry)| entry.0);
                if let Some(oldest) = oldest.map(|(key, _)| *key) {
                    entries.of.remove(&oldest);
                }
            }
            let entry = entries.of.entry(key).or_default();
            entry.0 = now;
            entry.1.clone()
        };
        cell.get_or_init(|| Arc::new(build())).clone()
    }

    /// Number of objects in the cache.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.entries
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .of
            .len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn the_cache_stays_small_and_drops_the_least_recently_used() {
        let cache = Cache::new(3);
        let built = AtomicUsize::new(0);
        let get = |key: u64| {
            let value = cache.get(key, || {
                built.fetch_add(1, Ordering::Relaxed);
                key * 10
            });
            assert_eq!(*value, key * 10);
            assert!(cache.len() <= 3);
        };
        (0..3).for_each(get);
        get(0);
        get(3);
        assert_eq!(built.load(Ordering::Relaxed), 4);
        get(0);
        assert_eq!(
            built.load(Ordering::Relaxed),
            4,
            "0 should be kept: it was used recently"
        );
        get(1);
        assert_eq!(
            built.load(Ordering::Relaxed),
            5,
            "1 should have made room for 3"
        );
        (10..200).for_each(get);
    }

    #[test]
    fn an_object_is_built_once_and_others_in_parallel() {
        let cache = Cache::new(4);
        let built = AtomicUsize::new(0);
        // Both builders must be inside at the same time: a lock held while building would deadlock here.
        let meet = Barrier::new(2);
        std::thread::scope(|scope| {
            for key in [1, 2, 1, 2] {
                let (cache, built, meet) = (&cache, &built, &meet);
                scope.spawn(move || {
                    cache.get(key, || {
                        built.fetch_add(1, Ordering::Relaxed);
                        meet.wait();
                    });
                });
            }
        });
        assert_eq!(built.load(Ordering::Relaxed), 2);
    }
}
