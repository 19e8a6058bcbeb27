//! Rayon in the child of a fork. The child has none of its parent's threads, so work given to the parent's pool would never be done.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::ThreadPool;

use super::STACK_BYTES;

/// The process that loaded this library.
static LOADED_BY: OnceLock<u32> = OnceLock::new();

/// The pools of children, each with its process id. A parent's pool is kept and never dropped: its threads do not exist here.
static POOLS: Mutex<Vec<(u32, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// Remembers this process as the owner of rayon's threads; later calls change nothing. To be called when the library is loaded into a
/// process that may be forked.
pub fn loaded_here() {
    LOADED_BY.get_or_init(process::id);
}

/// Does `work` where its parallel parts have threads: here, or, in the child of a fork ([`loaded_here`]), in a pool that is made once
/// for that process.
pub fn in_this_process<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    match pool() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// The pool of this process if it is the child of a fork; `None` if it has rayon's common pool, or no pool can be made.
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
