//! The program's memory.

/// Training allocates and frees megabytes in every operation; the system's allocator gives each of
/// them back to the kernel and asks again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// `mi_option_purge_delay` of mimalloc.h, the same number in its versions 2 and 3: after how many milliseconds freed
/// memory goes back to the system.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;

fn set_purge_delay(milliseconds: std::ffi::c_long) {
    // SAFETY: setting a documented option to a documented value has no precondition.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, milliseconds) };
}

/// Keeps freed memory: for Burn, whose every operation needs it again; the kernel clears every page that it hands
/// out (a tenth of a training step's profile).
pub fn keep_memory() {
    set_purge_delay(-1);
}

/// Gives freed memory back at once while `work` runs: packing a network frees its weights one by one, and the peak
/// would hold them all twice.
pub(crate) fn without_hoarding<T>(work: impl FnOnce() -> T) -> T {
    // SAFETY: reading a documented option has no precondition.
    let usual = unsafe { libmimalloc_sys::mi_option_get(PURGE_DELAY) };
    set_purge_delay(0);
    let result = work();
    set_purge_delay(usual);
    result
}
