//! What a single pixel and a mask do to every pixel of a value: attention and aggregation.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// y = x ⊙ (s · c), or x ⊙ (1 + s · c) with `residual`.
#[derive(Debug)]
pub(crate) struct Gate {
    /// x.
    pub(crate) input: View,
    /// s, in its first channel.
    pub(crate) spatial: View,
    /// c, one pixel.
    pub(crate) channel: View,
    pub(crate) residual: bool,
    pub(crate) out: View,
}

impl Gate {
    /// # Safety
    /// The views must lie in the arena, the output apart from the others, and nobody else use it.
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
                    // SAFETY: a pixel of the mask.
                    let spatial = unsafe { *arena.at(self.spatial.at(x, y)) };
                    value * (shift + spatial.value() * channel)
                },
            });
        });
    }
}

/// y = x + v at every pixel.
///
/// # Safety
/// As [`Gate::run`].
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

/// A row of an operation on every pixel's channels and those of one pixel.
struct Row<'a, E, F> {
    arena: Shared<E>,
    input: &'a View,
    pixel: &'a View,
    out: &'a View,
    y: usize,
    /// Of the column, a value, and the pixel's value of that channel.
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
        // SAFETY: pixels of the views; the output's row is this task's alone.
        unsafe {
            let pixel = std::slice::from_raw_parts(arena.at(pixel.offset), count);
            for x in 0..out.width {
                let from = std::slice::from_raw_parts(arena.at(input.at(x, y)), count);
                let to = std::slice::from_raw_parts_mut(arena.at(out.at(x, y)), count);
                for ((to, from), pixel) in to.iter_mut().zip(from).zip(pixel) {
                    *to = E::of(apply(x, from.value(), pixel.value()));
                }
            }
        }
    }
}
