//! The program's memory.

/// Training allocates and frees megabytes in every operation; the system's allocator gives each of
/// them back to the kernel and asks again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Keeps freed memory instead of returning it to the system after 10 ms: the next step needs it again,
/// and the kernel clears every page that it hands out (a tenth of a training step's profile).
pub fn keep_memory() {
    /// `mi_option_purge_delay` of mimalloc.h, the same number in its versions 2 and 3.
    const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
    // SAFETY: setting a documented option to a documented value (−1: never) has no precondition.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, -1) };
}
