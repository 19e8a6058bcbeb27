//! Operations that apply a single pixel or a mask to every pixel of a value: attention and aggregation.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// y = x ⊙ (s · c), or x ⊙ (1 + s · c) with `residual`.
#[derive(Debug)]
pub(crate) struct Gate {
    /// x, the input.
    pub(crate) input: View,
    /// s, the spatial mask, in its first channel.
    pub(crate) spatial: View,
    /// c, the channel mask, a single pixel.
    pub(crate) channel: View,
    pub(crate) residual: bool,
    pub(crate) out: View,
}

impl Gate {
    /// # Safety
    /// The views must be in the arena, and the output must not overlap the others. Nobody else may use the output or write the others.
    pub(crate) unsafe fn run<E: Element>(&self, arena: Shared<E>) {
        let shift = if self.residual { 1.0 } else { 0.0 };
        (0..self.out.height).into_par_iter().for_each(|y| {
            dispatch(Row {
                arena,
                input: &self.input,
                pixel: &self.channel,
                out: &self.out,
                y,
                apply: |x: usize, value: f32, channel: f32| {
                    // SAFETY: a pixel of the mask, which nobody writes (guaranteed by the caller).
                    let spatial = unsafe { arena.read(self.spatial.at(x, y), 1) };
                    value * (shift + spatial[0].value() * channel)
                },
            });
        });
    }
}

/// y = x + v at every pixel.
///
/// # Safety
/// As for [`Gate::run`].
pub(crate) unsafe fn add_pixel<E: Element>(
    arena: Shared<E>,
    input: &View,
    pixel: &View,
    out: &View,
) {
    (0..out.height).into_par_iter().for_each(|y| {
        dispatch(Row {
            arena,
            input,
            pixel,
            out,
            y,
            apply: |_, value: f32, added: f32| value + added,
        });
    });
}

/// One row of an operation that combines every pixel's channels with those of a single pixel.
struct Row<'a, E, F> {
    arena: Shared<'a, E>,
    input: &'a View,
    pixel: &'a View,
    out: &'a View,
    y: usize,
    /// Takes the column, a value, and the single pixel's value for that channel.
    apply: F,
}

impl<E: Element, F: Fn(usize, f32, f32) -> f32> WithSimd for Row<'_, E, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            input,
            pixel,
            out,
            y,
            apply,
        } = self;
        let count = out.channels;
        // SAFETY: a pixel's channels, which nobody writes (the contract of `run`).
        let pixel = unsafe { arena.read(pixel.offset, count) };
        for x in 0..out.width {
            // SAFETY: as above; the output's row is used by this task only.
            let (from, to) = unsafe {
                (
                    arena.read(input.at(x, y), count),
                    arena.write(out.at(x, y), count),
                )
            };
            for ((to, from), pixel) in to.iter_mut().zip(from).zip(pixel) {
                *to = E::of(apply(x, from.value(), pixel.value()));
            }
        }
    }
}
