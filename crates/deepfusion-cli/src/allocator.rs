//! The program's memory.

/// Training allocates and frees megabytes in every operation. The system's allocator would return them to the kernel and
/// request them again each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// `mi_option_purge_delay` of mimalloc.h, with the same number in its versions 2 and 3: the milliseconds after which freed
/// memory is returned to the system.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;

fn set_purge_delay(milliseconds: std::ffi::c_long) {
    // SAFETY: setting a documented option to a documented value has no precondition.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, milliseconds) };
}

/// Keeps freed memory, for Burn, which needs it again in its next operation. The kernel would clear every page that it hands
/// out, which took a tenth of a training step.
pub fn keep_memory() {
    set_purge_delay(-1);
}

/// Returns freed memory to the system at once while `work` runs. Packing a network frees its weights one by one; if they were kept,
/// the peak would hold all weights twice.
pub(crate) fn without_hoarding<T>(work: impl FnOnce() -> T) -> T {
    // SAFETY: reading a documented option has no precondition.
    let usual = unsafe { libmimalloc_sys::mi_option_get(PURGE_DELAY) };
    set_purge_delay(0);
    let result = work();
    set_purge_delay(usual);
    result
}
