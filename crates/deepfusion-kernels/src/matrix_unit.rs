//! AMX, the matrix unit of Xeon processors since Sapphire Rapids. It has eight tile registers of at most 16 rows of 64 bytes, and an
//! instruction that multiplies two of them, as pairs of bf16, and adds the product to a third. There are no stable intrinsics, so its users
//! are written in assembly.

use std::arch::asm;
use std::sync::OnceLock;

/// Whether the processor has the unit and the system allows this process to use it.
#[must_use]
pub fn available() -> bool {
    static AVAILABLE: OnceLock<bool> = OnceLock::new();
    *AVAILABLE.get_or_init(|| has_tiles() && may_use_tiles())
}

fn has_tiles() -> bool {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    const BF16: u32 = 1 << 22;
    const TILES: u32 = 1 << 24;
    __cpuid(0).eax >= 7 && __cpuid_count(7, 0).edx & (BF16 | TILES) == BF16 | TILES
}

/// Linux grants the tile registers' state to a process that requests it; its threads share the grant.
#[cfg(target_os = "linux")]
fn may_use_tiles() -> bool {
    const ARCH_PRCTL: i64 = 158;
    const ARCH_REQ_XCOMP_PERM: i64 = 0x1023;
    const XFEATURE_XTILEDATA: i64 = 18;
    let result: i64;
    // SAFETY: a system call that does not access this program's memory.
    unsafe {
        asm!(
            "syscall",
            inlateout("rax") ARCH_PRCTL => result,
            in("rdi") ARCH_REQ_XCOMP_PERM,
            in("rsi") XFEATURE_XTILEDATA,
            out("rcx") _,
            out("r11") _,
        );
    }
    result == 0
}

/// Not implemented for other systems.
#[cfg(not(target_os = "linux"))]
fn may_use_tiles() -> bool {
    false
}

/// The sizes of the tile registers. Registers 0 to 3 have 16 rows of 64 bytes, for sums of 16×16. Of the factors, 4 and 5 are those of the
/// sums' rows, 6 and 7 those of their columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileSizes {
    /// Number of pairs of bf16 that a product sums, 1 to 16: the length of a row of the registers 4 and 5, and the number
    /// of rows, of 64 bytes each, of the registers 6 and 7.
    pub pairs: usize,
}

impl TileSizes {
    /// Eight tiles of 16 rows of 64 bytes.
    pub const WHOLE: Self = Self { pairs: 16 };

    /// The palette in the unit's format: the number of the palette, then the bytes per row and the number of rows of each register.
    fn palette(self) -> Palette {
        assert!((1..=16).contains(&self.pairs), "pairs of a product");
        let pairs = self.pairs as u8;
        let mut palette = Palette([0; 64]);
        palette.0[0] = 1;
        for tile in 0..8 {
            palette.0[16 + 2 * tile] = if matches!(tile, 4 | 5) { 4 * pairs } else { 64 };
            palette.0[48 + tile] = if matches!(tile, 6 | 7) { pairs } else { 16 };
        }
        palette
    }
}

#[repr(align(64))]
struct Palette([u8; 64]);

/// Runs `work` with this thread's tile registers configured, then releases them, so that the system need no longer save them.
///
/// The configuration is the only state that lasts from one `asm!` block to the next. That is sound: the compiler does not know this state
/// and allocates no tile registers, only such work uses the unit, and the system saves the state for each thread. Configuring for every
/// product would clear all registers every time.
///
/// # Safety
/// The unit must be [`available`]. The work must not configure the registers itself, nor wait for other work on this thread that does, such
/// as a rayon task.
///
/// # Panics
/// Unless there are 1 to 16 pairs.
pub unsafe fn configured<R>(sizes: TileSizes, work: impl FnOnce() -> R) -> R {
    /// Releases the registers, also if the work panics.
    struct Release;

    impl Drop for Release {
        fn drop(&mut self) {
            // SAFETY: the unit exists, as it was configured; all registers are cleared, and declared as such; no memory is accessed.
            unsafe {
                asm!(
                    "tilerelease",
                    out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                    out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                    options(nostack, nomem, preserves_flags),
                );
            }
        }
    }

    let palette = sizes.palette();
    // SAFETY: 64 bytes that describe a valid palette; all registers are cleared, and declared as such.
    unsafe {
        asm!(
            "ldtilecfg [{}]", in(reg) &raw const palette.0,
            out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
            out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
            options(nostack, readonly, preserves_flags),
        );
    }
    let _release = Release;
    work()
}
