//! Both products on the matrix unit: 2×2 tiles of sums, for which each step loads four tiles of factors.
//!
//! Tiles 0 to 3 contain the sums, 4 and 5 the factors of the rows, 6 and 7 those of the columns.

use super::{COLUMNS, PixelPairs, ROWS, TapPairs};
use crate::matrix_unit::{TileSizes, configured};
use std::arch::asm;

/// Steps summed before the sums are written to memory, so that the rows' factors stay in the L1 cache.
const STEPS_AT_ONCE: usize = 18;
/// Steps of the weight gradient, so that the columns' factors, which all channels and taps multiply, stay in the L1 cache.
const PIXEL_STEPS_AT_ONCE: usize = 16;
/// Words of a tile's row.
const WORDS: usize = 16;

/// # Safety
/// The processor must have the unit; bounds must be as [`TapPairs::run`] checks them.
pub(super) unsafe fn taps(product: TapPairs) {
    let TapPairs {
        weights,
        offsets,
        pairs,
        plane_len,
        source,
        columns,
        out,
        rows,
    } = product;
    let tile = ROWS * pairs;
    let block = offsets.len() * tile;
    let sizes = TileSizes { pairs };
    let work = || {
        for (index, steps) in offsets.chunks(STEPS_AT_ONCE).enumerate() {
            let first_step = index * STEPS_AT_ONCE;
            for row in (0..rows).step_by(2 * ROWS) {
                let two = rows - row > ROWS;
                let of_block =
                    |b: usize| weights.as_ptr().wrapping_add(b * block + first_step * tile);
                let factors = [
                    of_block(row / ROWS),
                    of_block(row / ROWS + usize::from(two)),
                ];
                for column in (0..columns).step_by(COLUMNS) {
                    let at = Steps {
                        rows: factors,
                        row_stride: 4 * pairs,
                        row_step: 4 * tile,
                        columns: source.as_ptr().wrapping_add(column),
                        column_stride: 4 * plane_len,
                        offsets: steps,
                        sums: out.as_mut_ptr().wrapping_add(row * columns + column),
                        sum_stride: 4 * columns,
                        add: index > 0,
                    };
                    // SAFETY: guaranteed by the caller.
                    unsafe {
                        if two {
                            at.two_by_two()
                        } else {
                            at.one_by_two()
                        }
                    }
                }
            }
        }
    };
    // SAFETY: the processor has the unit (guaranteed by the caller).
    unsafe { configured(sizes, work) };
}

/// Sums over steps; a table contains the offsets of the column factors.
struct Steps<'a> {
    rows: [*const u32; 2],
    /// Bytes from one row to the next.
    row_stride: usize,
    /// Bytes from one step to the next.
    row_step: usize,
    columns: *const u32,
    /// Bytes from one pair to the next.
    column_stride: usize,
    /// Offset of each step's first pair, in words.
    offsets: &'a [usize],
    sums: *mut f32,
    /// Bytes from one row of sums to the next.
    sum_stride: usize,
    /// Whether to add to the existing sums.
    add: bool,
}

impl Steps<'_> {
    /// Computes two tiles of rows.
    ///
    /// # Safety
    /// All pointers and strides must be in bounds, the tiles configured, and the offsets not empty.
    unsafe fn two_by_two(&self) {
        let below = self.sums.wrapping_byte_add(ROWS * self.sum_stride);
        let range = self.offsets.as_ptr_range();
        // SAFETY: guaranteed by the caller; the written registers are declared.
        unsafe {
            asm!(
                "test {add}, {add}",
                "jz 2f",
                "tileloadd tmm0, [{c} + {sc}*1]",
                "tileloadd tmm1, [{c} + {sc}*1 + 64]",
                "tileloadd tmm2, [{d} + {sc}*1]",
                "tileloadd tmm3, [{d} + {sc}*1 + 64]",
                "jmp 3f",
                "2:",
                "tilezero tmm0",
                "tilezero tmm1",
                "tilezero tmm2",
                "tilezero tmm3",
                "3:",
                "mov {p}, [{offset}]",
                "lea {p}, [{b} + {p}*4]",
                "tileloadd tmm6, [{p} + {sb}*1]",
                "tileloadd tmm4, [{a0} + {sa}*1]",
                "tileloadd tmm5, [{a1} + {sa}*1]",
                "tileloadd tmm7, [{p} + {sb}*1 + 64]",
                "add {a0}, {step}",
                "add {a1}, {step}",
                "add {offset}, 8",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tdpbf16ps tmm2, tmm5, tmm6",
                "tdpbf16ps tmm1, tmm4, tmm7",
                "tdpbf16ps tmm3, tmm5, tmm7",
                "cmp {offset}, {end}",
                "jne 3b",
                "tilestored [{c} + {sc}*1], tmm0",
                "tilestored [{c} + {sc}*1 + 64], tmm1",
                "tilestored [{d} + {sc}*1], tmm2",
                "tilestored [{d} + {sc}*1 + 64], tmm3",
                c = in(reg) self.sums,
                d = in(reg) below,
                sc = in(reg) self.sum_stride,
                b = in(reg) self.columns,
                sb = in(reg) self.column_stride,
                sa = in(reg) self.row_stride,
                step = in(reg) self.row_step,
                end = in(reg) range.end,
                offset = inout(reg) range.start => _,
                a0 = inout(reg) self.rows[0] => _,
                a1 = inout(reg) self.rows[1] => _,
                add = inout(reg) usize::from(self.add) => _,
                p = out(reg) _,
                out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
    }

    /// Computes one tile of rows.
    ///
    /// # Safety
    /// As for [`Self::two_by_two`].
    unsafe fn one_by_two(&self) {
        let range = self.offsets.as_ptr_range();
        // SAFETY: as in [`Self::two_by_two`].
        unsafe {
            asm!(
                "test {add}, {add}",
                "jz 2f",
                "tileloadd tmm0, [{c} + {sc}*1]",
                "tileloadd tmm1, [{c} + {sc}*1 + 64]",
                "jmp 3f",
                "2:",
                "tilezero tmm0",
                "tilezero tmm1",
                "3:",
                "mov {p}, [{offset}]",
                "lea {p}, [{b} + {p}*4]",
                "tileloadd tmm6, [{p} + {sb}*1]",
                "tileloadd tmm4, [{a0} + {sa}*1]",
                "tileloadd tmm7, [{p} + {sb}*1 + 64]",
                "add {a0}, {step}",
                "add {offset}, 8",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tdpbf16ps tmm1, tmm4, tmm7",
                "cmp {offset}, {end}",
                "jne 3b",
                "tilestored [{c} + {sc}*1], tmm0",
                "tilestored [{c} + {sc}*1 + 64], tmm1",
                c = in(reg) self.sums,
                sc = in(reg) self.sum_stride,
                b = in(reg) self.columns,
                sb = in(reg) self.column_stride,
                sa = in(reg) self.row_stride,
                step = in(reg) self.row_step,
                end = in(reg) range.end,
                offset = inout(reg) range.start => _,
                a0 = inout(reg) self.rows[0] => _,
                add = inout(reg) usize::from(self.add) => _,
                p = out(reg) _,
                out("tmm0") _, out("tmm1") _, out("tmm4") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
    }
}

/// # Safety
/// The processor must have the unit; bounds must be as [`PixelPairs::run`] checks them.
pub(super) unsafe fn pixels(product: PixelPairs) {
    let PixelPairs {
        offsets,
        plane_len,
        channels,
        source,
        pixels,
        grad,
        outputs,
        out,
    } = product;
    let (taps, sums) = (offsets.len(), out.as_mut_ptr());
    let sizes = TileSizes::WHOLE;
    let per_step = 2 * WORDS;
    let work = || {
        for first in (0..pixels).step_by(PIXEL_STEPS_AT_ONCE * per_step) {
            let steps = (pixels - first).min(PIXEL_STEPS_AT_ONCE * per_step) / per_step;
            for output in (0..outputs).step_by(2 * ROWS) {
                let wide = outputs - output > ROWS;
                for channel in (0..channels).step_by(2 * ROWS) {
                    let two = channels - channel > ROWS;
                    for (t, offset) in offsets.iter().enumerate() {
                        let row =
                            |c: usize| source.as_ptr().wrapping_add(c * plane_len + offset + first);
                        let sum = |c: usize| sums.wrapping_add((c * taps + t) * outputs + output);
                        let at = PixelSteps {
                            rows: [row(channel), row(channel + ROWS * usize::from(two))],
                            row_stride: 2 * plane_len,
                            columns: grad.as_ptr().wrapping_add(first / 2 * outputs + output),
                            column_stride: 4 * outputs,
                            column_step: 4 * outputs * WORDS,
                            steps,
                            sums: [sum(channel), sum(channel + ROWS * usize::from(two))],
                            sum_stride: 4 * taps * outputs,
                        };
                        // SAFETY: guaranteed by the caller.
                        unsafe {
                            match (two, wide) {
                                (true, true) => at.two_by_two(),
                                (true, false) => at.two_by_one(),
                                (false, true) => at.one_by_two(),
                                (false, false) => at.one_by_one(),
                            }
                        }
                    }
                }
            }
        }
    };
    // SAFETY: the processor has the unit (guaranteed by the caller).
    unsafe { configured(sizes, work) };
}

/// Sums over neighbouring pixels, added to the existing sums.
struct PixelSteps {
    rows: [*const u16; 2],
    /// Bytes from one channel to the next.
    row_stride: usize,
    columns: *const u32,
    /// Bytes from one pair of pixels to the next.
    column_stride: usize,
    /// Bytes from one step to the next.
    column_step: usize,
    steps: usize,
    sums: [*mut f32; 2],
    /// Bytes from one channel's sums to the next channel's.
    sum_stride: usize,
}

/// The four shapes of a block of sums: which tiles it loads, multiplies and stores.
macro_rules! block {
    ($name:ident, $doc:literal, [$($load:literal),*], [$($factor:literal),*], [$($product:literal),*], [$($store:literal),*]) => {
        #[doc = $doc]
        ///
        /// # Safety
        /// All pointers and strides must be in bounds, the tiles configured, and the number of steps at least one.
        unsafe fn $name(&self) {
            // SAFETY: guaranteed by the caller; the written registers are declared.
            unsafe {
                asm!(
                    $($load,)*
                    "3:",
                    $($factor,)*
                    "add {a0}, 64",
                    "add {a1}, 64",
                    "add {b}, {step}",
                    $($product,)*
                    "dec {left}",
                    "jnz 3b",
                    $($store,)*
                    // Every operand must be used, even if the block has no second row of sums.
                    "/* {c1} */",
                    c0 = in(reg) self.sums[0],
                    c1 = in(reg) self.sums[1],
                    sc = in(reg) self.sum_stride,
                    b = inout(reg) self.columns => _,
                    sb = in(reg) self.column_stride,
                    step = in(reg) self.column_step,
                    sa = in(reg) self.row_stride,
                    a0 = inout(reg) self.rows[0] => _,
                    a1 = inout(reg) self.rows[1] => _,
                    left = inout(reg) self.steps => _,
                    out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                    out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                    options(nostack),
                );
            }
        }
    };
}

impl PixelSteps {
    block!(
        two_by_two,
        "32 channels by 32 outputs.",
        [
            "tileloadd tmm0, [{c0} + {sc}*1]",
            "tileloadd tmm1, [{c0} + {sc}*1 + 64]",
            "tileloadd tmm2, [{c1} + {sc}*1]",
            "tileloadd tmm3, [{c1} + {sc}*1 + 64]"
        ],
        [
            "tileloadd tmm6, [{b} + {sb}*1]",
            "tileloadd tmm4, [{a0} + {sa}*1]",
            "tileloadd tmm5, [{a1} + {sa}*1]",
            "tileloadd tmm7, [{b} + {sb}*1 + 64]"
        ],
        [
            "tdpbf16ps tmm0, tmm4, tmm6",
            "tdpbf16ps tmm2, tmm5, tmm6",
            "tdpbf16ps tmm1, tmm4, tmm7",
            "tdpbf16ps tmm3, tmm5, tmm7"
        ],
        [
            "tilestored [{c0} + {sc}*1], tmm0",
            "tilestored [{c0} + {sc}*1 + 64], tmm1",
            "tilestored [{c1} + {sc}*1], tmm2",
            "tilestored [{c1} + {sc}*1 + 64], tmm3"
        ]
    );
    block!(
        two_by_one,
        "32 channels by 16 outputs.",
        [
            "tileloadd tmm0, [{c0} + {sc}*1]",
            "tileloadd tmm2, [{c1} + {sc}*1]"
        ],
        [
            "tileloadd tmm6, [{b} + {sb}*1]",
            "tileloadd tmm4, [{a0} + {sa}*1]",
            "tileloadd tmm5, [{a1} + {sa}*1]"
        ],
        ["tdpbf16ps tmm0, tmm4, tmm6", "tdpbf16ps tmm2, tmm5, tmm6"],
        [
            "tilestored [{c0} + {sc}*1], tmm0",
            "tilestored [{c1} + {sc}*1], tmm2"
        ]
    );
    block!(
        one_by_two,
        "16 channels by 32 outputs.",
        [
            "tileloadd tmm0, [{c0} + {sc}*1]",
            "tileloadd tmm1, [{c0} + {sc}*1 + 64]"
        ],
        [
            "tileloadd tmm6, [{b} + {sb}*1]",
            "tileloadd tmm4, [{a0} + {sa}*1]",
            "tileloadd tmm7, [{b} + {sb}*1 + 64]"
        ],
        ["tdpbf16ps tmm0, tmm4, tmm6", "tdpbf16ps tmm1, tmm4, tmm7"],
        [
            "tilestored [{c0} + {sc}*1], tmm0",
            "tilestored [{c0} + {sc}*1 + 64], tmm1"
        ]
    );
    block!(
        one_by_one,
        "16 channels by 16 outputs.",
        ["tileloadd tmm0, [{c0} + {sc}*1]"],
        [
            "tileloadd tmm6, [{b} + {sb}*1]",
            "tileloadd tmm4, [{a0} + {sa}*1]"
        ],
        ["tdpbf16ps tmm0, tmm4, tmm6"],
        ["tilestored [{c0} + {sc}*1], tmm0"]
    );
}
