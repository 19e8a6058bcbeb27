//! Pixel-wise products of values of the same shape: the gates of a recurrent network.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// y = a ⊙ b.
///
/// # Safety
/// The views must be in the arena, all with the same channels, and `out` must not overlap the others. Nobody else may use `out` or write
/// the others.
pub(crate) unsafe fn multiply<E: Element>(arena: Shared<E>, [a, b]: [&View; 2], out: &View) {
    // SAFETY: guaranteed by the caller.
    unsafe { rows(arena, [a, b, b], out, |a, b, _| a * b) }
}

/// y = (1 − z) ⊙ h + z ⊙ q.
///
/// # Safety
/// As for [`multiply`].
pub(crate) unsafe fn blend<E: Element>(arena: Shared<E>, [h, q, z]: [&View; 3], out: &View) {
    // SAFETY: guaranteed by the caller.
    unsafe { rows(arena, [h, q, z], out, |h, q, z| h + z * (q - h)) }
}

/// Applies a function to three values of each channel of each pixel.
///
/// # Safety
/// As for [`multiply`].
unsafe fn rows<E: Element>(
    arena: Shared<E>,
    from: [&View; 3],
    out: &View,
    apply: impl Fn(f32, f32, f32) -> f32 + Copy + Sync,
) {
    (0..out.height).into_par_iter().for_each(|y| {
        dispatch(Row {
            arena,
            from,
            out,
            y,
            apply,
        });
    });
}

struct Row<'a, E, F> {
    arena: Shared<'a, E>,
    from: [&'a View; 3],
    out: &'a View,
    y: usize,
    apply: F,
}

impl<E: Element, F: Fn(f32, f32, f32) -> f32> WithSimd for Row<'_, E, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            from,
            out,
            y,
            apply,
        } = self;
        let count = out.channels;
        for x in 0..out.width {
            // SAFETY: a pixel of each view, which nobody writes, and one of `out`, whose row is used by this task only (the contract of
            // `multiply` and `blend`).
            let ([a, b, c], to) = unsafe {
                (
                    from.map(|view| arena.read(view.at(x, y), count)),
                    arena.write(out.at(x, y), count),
                )
            };
            let values = a.iter().zip(b).zip(c);
            for (to, ((a, b), c)) in to.iter_mut().zip(values) {
                *to = E::of(apply(a.value(), b.value(), c.value()));
            }
        }
    }
}
