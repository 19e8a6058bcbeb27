//! Bilinear enlargement by 2, and constants that encode a pixel's position.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// Twice the size with half-pixel centres: each output pixel is three quarters of the nearest input pixel and a quarter of the next along
/// each axis. Pixels beyond the border repeat those at the border.
///
/// # Safety
/// The views must be in the arena and must not overlap. Nobody else may use `to` or write `from`.
pub(crate) unsafe fn enlarge<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    // The output rows between two input rows, including those before the first and after the last.
    (0..from.height + 1).into_par_iter().for_each(|gap| {
        dispatch(Gap {
            arena,
            from,
            to,
            gap,
        });
    });
}

struct Gap<'a, E> {
    arena: Shared<'a, E>,
    from: &'a View,
    to: &'a View,
    gap: usize,
}

impl<E: Element> WithSimd for Gap<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            from,
            to,
            gap,
        } = self;
        let channels = from.channels;
        let (above, below) = (gap.saturating_sub(1), gap.min(from.height - 1));
        // Whether there is an output row in the upper and in the lower half of the gap.
        let rows = [gap > 0, gap < from.height];
        for side in 0..from.width + 1 {
            let (left, right) = (side.saturating_sub(1), side.min(from.width - 1));
            let columns = [side > 0, side < from.width];
            let corner = |x: usize, y: usize| {
                // SAFETY: a pixel of the view, which nobody writes (the contract of `enlarge`).
                unsafe { arena.read(from.at(x, y), channels) }
            };
            let [a, b, c, d] = [
                corner(left, above),
                corner(right, above),
                corner(left, below),
                corner(right, below),
            ];
            for (row, there) in rows.into_iter().enumerate() {
                if !there {
                    continue;
                }
                let down = [0.25, 0.75][row];
                for (column, there) in columns.into_iter().enumerate() {
                    if !there {
                        continue;
                    }
                    let across = [0.25, 0.75][column];
                    let (x, y) = (2 * side + column - 1, 2 * gap + row - 1);
                    // SAFETY: a pixel of `to`; the two rows of a gap are used by this task only.
                    let out = unsafe { arena.write(to.at(x, y), channels) };
                    let corners = a.iter().zip(b).zip(c.iter().zip(d));
                    for (out, ((a, b), (c, d))) in out.iter_mut().zip(corners) {
                        let upper = a.value() + (b.value() - a.value()) * across;
                        let lower = c.value() + (d.value() - c.value()) * across;
                        *out = E::of(upper + (lower - upper) * down);
                    }
                }
            }
        }
    }
}

/// Writes constants, pixel by pixel.
///
/// # Safety
/// `to` must be in the arena, and nobody else may use it.
pub(crate) unsafe fn constants<E: Element>(arena: Shared<E>, values: &[f32], to: &View) {
    (0..to.height).into_par_iter().for_each(|y| {
        for x in 0..to.width {
            let values = &values[(y * to.width + x) * to.channels..][..to.channels];
            // SAFETY: a pixel of `to`, whose row is used by this task only (guaranteed by the caller).
            let out = unsafe { arena.write(to.at(x, y), to.channels) };
            for (out, value) in out.iter_mut().zip(values) {
                *out = E::of(*value);
            }
        }
    });
}
