//! Operations that only move values: normalising the image, borders, max pooling, enlarging.

use rayon::prelude::*;

use crate::element::Element;
use crate::view::{Shared, View};

/// How an image is normalised: (x − mean) / std for red, green and blue.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Normalisation {
    pub(crate) mean: [f32; 3],
    pub(crate) std: [f32; 3],
}

impl Normalisation {
    /// Writes the normalised image with interleaved channels.
    ///
    /// # Safety
    /// `to` must be in the arena, and nobody else may use it.
    pub(crate) unsafe fn run<E: Element>(self, image: &[f32], arena: Shared<E>, to: &View) {
        let planes: [&[f32]; 3] = std::array::from_fn(|c| &image[c * to.pixels()..][..to.pixels()]);
        (0..to.height).into_par_iter().for_each(|y| {
            let rows = planes.map(|plane| &plane[y * to.width..][..to.width]);
            for x in 0..to.width {
                // SAFETY: a pixel's three channels, which nobody else uses (guaranteed by the caller). Not the whole row, as channels of
                // other values may be in between.
                let out = unsafe { arena.write(to.at(x, y), 3) };
                for (c, out) in out.iter_mut().enumerate() {
                    *out = E::of((rows[c][x] - self.mean[c]) / self.std[c]);
                }
            }
        });
    }
}

/// A pixel's channels, of which other threads may read some at the same time.
///
/// # Safety
/// Nobody may write them during the lifetime of the slice.
#[inline(always)]
unsafe fn pixel_of<'a, E>(arena: Shared<'a, E>, view: &View, at: usize) -> &'a [E] {
    // SAFETY: guaranteed by the caller.
    unsafe { arena.read(at, view.channels) }
}

/// A pixel's channels, for writing.
///
/// # Safety
/// Nobody else may read or write them during the lifetime of the slice.
#[inline(always)]
unsafe fn pixel_to<'a, E>(arena: Shared<'a, E>, view: &View, at: usize) -> &'a mut [E] {
    // SAFETY: guaranteed by the caller.
    unsafe { arena.write(at, view.channels) }
}

/// Calls `each` with the offset of every border pixel up to `reach`, and the offset of the image pixel that it mirrors.
pub(crate) fn for_border(view: &View, reach: usize, mut each: impl FnMut(usize, usize)) {
    let (w, h, r) = (view.width as isize, view.height as isize, reach as isize);
    let mirror = |i: isize, n: isize| {
        let i = i.abs();
        if i < n { i } else { 2 * (n - 1) - i }
    };
    let at = |x: isize, y: isize| {
        let from_start = |i: isize| (i + view.border as isize) as usize;
        view.start() + from_start(y) * view.row + from_start(x) * view.pitch
    };
    for y in -r..h + r {
        let inside = (0..h).contains(&y);
        for x in (-r..w + r).filter(|x| !inside || !(0..w).contains(x)) {
            each(at(x, y), at(mirror(x, w), mirror(y, h)));
        }
    }
}

/// # Safety
/// The view must be in the arena, and nobody else may use it.
pub(crate) unsafe fn zero_border<E: Element>(arena: Shared<E>, view: &View, reach: usize) {
    for_border(view, reach, |at, _| {
        // SAFETY: a pixel of the view's border, which nobody else uses (guaranteed by the caller).
        unsafe { pixel_to(arena, view, at) }.fill(E::default());
    });
}

/// # Safety
/// As for [`zero_border`].
pub(crate) unsafe fn reflect_border<E: Element>(arena: Shared<E>, view: &View, reach: usize) {
    for_border(view, reach, |at, from| {
        // SAFETY: a pixel of the view's border and one inside, which nobody else uses (guaranteed by the caller).
        unsafe { pixel_to(arena, view, at).copy_from_slice(pixel_of(arena, view, from)) };
    });
}

/// The maximum over 3×3 pixels at stride 2; pixels beyond the edge are ignored.
///
/// # Safety
/// The views must be in the arena and must not overlap. Nobody else may use `to` or write `from`.
pub(crate) unsafe fn max_pool<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    (0..to.height).into_par_iter().for_each(|y| {
        for x in 0..to.width {
            // SAFETY: a pixel of `to`, whose row is used by this task only.
            let out = unsafe { pixel_to(arena, to, to.at(x, y)) };
            let within = |i: usize, n: usize| (2 * i).saturating_sub(1)..(2 * i + 2).min(n);
            let mut first = true;
            for i in within(y, from.height) {
                for j in within(x, from.width) {
                    // SAFETY: a pixel of `from`, which nobody writes; other tasks may read it, too.
                    let pixel = unsafe { pixel_of(arena, from, from.at(j, i)) };
                    if first {
                        out.copy_from_slice(pixel);
                        first = false;
                        continue;
                    }
                    for (out, v) in out.iter_mut().zip(pixel) {
                        // NaN stays NaN.
                        let v = *v;
                        let wins = v > *out || v.partial_cmp(&v).is_none();
                        *out = if wins { v } else { *out };
                    }
                }
            }
        }
    });
}

/// Repeats every pixel 2×2 times.
///
/// # Safety
/// As for [`max_pool`].
pub(crate) unsafe fn upsample<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    (0..from.height).into_par_iter().for_each(|y| {
        for x in 0..from.width {
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                // SAFETY: a pixel of `from`, which nobody writes, and one of `to`, in two rows that are used by this task only.
                unsafe {
                    let pixel = pixel_of(arena, from, from.at(x, y));
                    pixel_to(arena, from, to.at(2 * x + dx, 2 * y + dy)).copy_from_slice(pixel);
                }
            }
        }
    });
}

/// Copies the channels of `from` to the first channels of `to`.
///
/// # Safety
/// As for [`max_pool`].
pub(crate) unsafe fn copy<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    (0..from.height).into_par_iter().for_each(|y| {
        for x in 0..from.width {
            // SAFETY: a pixel of `from`, which nobody writes, and one of `to`, whose row is used by this task only.
            unsafe {
                let pixel = pixel_of(arena, from, from.at(x, y));
                pixel_to(arena, from, to.at(x, y)).copy_from_slice(pixel);
            }
        }
    });
}

/// Rearranges every pixel's channels into 2×2 pixels with `to`'s channels, row by row (depth to space); pixels beyond its edge are left
/// out.
///
/// # Safety
/// As for [`max_pool`]; `from` must have four times as many channels as `to`, without gaps.
pub(crate) unsafe fn depth_to_space<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    (0..to.height).into_par_iter().for_each(|y| {
        for x in 0..to.width {
            let part = (2 * (y % 2) + x % 2) * to.channels;
            // SAFETY: channels of a pixel of `from`, which nobody writes, and a pixel of `to`, whose row is used by this task only.
            unsafe {
                let pixel = arena.read(from.at(x / 2, y / 2) + part, to.channels);
                pixel_to(arena, to, to.at(x, y)).copy_from_slice(pixel);
            }
        }
    });
}
