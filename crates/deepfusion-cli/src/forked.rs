//! Rayon in the child of a fork: of its parent's threads none came along, and what is handed to their pool would be waited for for ever.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::ThreadPool;

use super::STACK_BYTES;

/// The process that loaded this library.
static LOADED_BY: OnceLock<u32> = OnceLock::new();

/// The pools of children, each with its process. That of a parent is kept and never ended: its threads are not there.
static POOLS: Mutex<Vec<(u32, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// Remembers this process as the one whose rayon threads are its own; a later call changes nothing. For libraries in a process that may
/// be forked, when they are loaded.
pub fn loaded_here() {
    LOADED_BY.get_or_init(process::id);
}

/// Does `work` where its parallel parts have threads: here, and in the child of a fork ([`loaded_here`]) in a pool that is made for that
/// process once.
pub fn in_this_process<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    match pool() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// The pool of this process, where it is the child of a fork; `None` where rayon's common one is there, or no pool can be made.
pub(super) fn pool() -> Option<Arc<ThreadPool>> {
    let (loaded_by, here) = (*LOADED_BY.get()?, process::id());
    if here == loaded_by {
        return None;
    }
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, pool)) = pools.iter().find(|(process, _)| *process == here) {
        return Some(Arc::clone(pool));
    }
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES);
    let pool = Arc::new(pool.build().ok()?);
    pools.push((here, Arc::clone(&pool)));
    Some(pool)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forking is tested from Python.
    #[test]
    fn the_process_that_loaded_it_has_the_common_pool() {
        assert!(pool().is_none());
        loaded_here();
        assert!(pool().is_none());
        assert_eq!(in_this_process(|| 7), 7);
    }
}
