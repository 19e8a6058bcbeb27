//! Transposes planar values to interleaved ones.

/// Side of the blocks of [`transpose`]: a block of rows and one of columns fit into the L1 cache together.
const BLOCK: usize = 16;

/// `to[q][r] = from[r][q]` for `rows` rows of `columns` values; the rest of each row of `to` is zeroed.
///
/// # Panics
/// When a slice is too short for its strides.
pub(super) fn transpose<T: Copy + Default>(
    from: &[T],
    from_stride: usize,
    rows: usize,
    columns: usize,
    to: &mut [T],
    to_stride: usize,
) {
    assert!(rows <= to_stride && to.len() >= columns * to_stride);
    for first_row in (0..to_stride).step_by(BLOCK) {
        let height = BLOCK.min(rows.saturating_sub(first_row));
        for first in (0..columns).step_by(BLOCK) {
            let width = BLOCK.min(columns - first);
            let mut block = [[T::default(); BLOCK]; BLOCK];
            for r in 0..height {
                let from = &from[(first_row + r) * from_stride + first..][..width];
                if width == BLOCK {
                    for q in 0..BLOCK {
                        block[q][r] = from[q];
                    }
                } else {
                    for q in 0..width {
                        block[q][r] = from[q];
                    }
                }
            }
            for q in 0..width {
                to[(first + q) * to_stride + first_row..][..BLOCK].copy_from_slice(&block[q]);
            }
        }
    }
}
