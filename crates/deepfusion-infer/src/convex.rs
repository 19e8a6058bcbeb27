//! Convex upsampling (RAFT, Teed and Deng, ECCV 2020): each pixel of the large image is a weighted mean of the 3×3 pixels around its place
//! in the small one, with weights that the network predicts for each pixel.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::activate::exp_negative;
use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// Number of pixels in a weighted mean.
const TAPS: usize = 9;

/// Upsampling of one channel by a factor of 2 to the power of `halvings`.
#[derive(Debug)]
pub(crate) struct ConvexUpsample {
    /// The values, in its first channel.
    pub(crate) input: View,
    /// The weights' logarithms, 9·4^halvings channels: for each tap (row by row), one for each pixel of a block (row by row).
    pub(crate) weights: View,
    pub(crate) halvings: u32,
    /// The output, one channel.
    pub(crate) out: View,
}

impl ConvexUpsample {
    /// # Safety
    /// The views must be in the arena and must not overlap. Nobody else may use the output or write the others.
    pub(crate) unsafe fn run<E: Element>(&self, arena: Shared<E>) {
        (0..self.input.height).into_par_iter().for_each(|y| {
            dispatch(Row {
                step: self,
                arena,
                y,
            });
        });
    }
}

/// Computes a row of blocks.
struct Row<'a, E> {
    step: &'a ConvexUpsample,
    arena: Shared<'a, E>,
    y: usize,
}

impl<E: Element> WithSimd for Row<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { step, arena, y } = self;
        let (input, side) = (&step.input, 1_usize << step.halvings);
        let block = side * side;
        // A tap's weights as whole vectors; results for the padding of the last one are discarded.
        let padded = block.next_multiple_of(S::F32_LANES);
        let mut logits = vec![0.0_f32; TAPS * padded];
        let mut mixed = vec![0.0_f32; padded];
        for x in 0..input.width {
            // SAFETY: a pixel's weights, which nobody writes (the contract of `run`).
            let weights = unsafe { arena.read(step.weights.at(x, y), TAPS * block) };
            for (to, from) in logits
                .chunks_exact_mut(padded)
                .zip(weights.chunks_exact(block))
            {
                to.iter_mut()
                    .zip(from)
                    .for_each(|(to, from)| *to = from.value());
            }
            let around: [f32; TAPS] = std::array::from_fn(|tap| {
                let (column, row) = ((x + tap % 3).checked_sub(1), (y + tap / 3).checked_sub(1));
                match (column, row) {
                    (Some(column), Some(row)) if column < input.width && row < input.height => {
                        // SAFETY: as above.
                        unsafe { arena.read(input.at(column, row), 1)[0].value() }
                    }
                    // Zeros beyond the edge.
                    _ => 0.0,
                }
            });
            let (mixed_vectors, _) = S::as_mut_simd_f32s(&mut mixed);
            for (i, to) in mixed_vectors.iter_mut().enumerate() {
                let of = |tap: usize| S::as_simd_f32s(&logits[tap * padded..][..padded]).0[i];
                let most = (1..TAPS).fold(of(0), |most, tap| simd.max_f32s(most, of(tap)));
                let (mut sum, mut total) = (simd.splat_f32s(0.0), simd.splat_f32s(0.0));
                for (tap, value) in around.into_iter().enumerate() {
                    let share = exp_negative(simd, simd.sub_f32s(of(tap), most));
                    total = simd.add_f32s(total, share);
                    sum = simd.mul_add_f32s(share, simd.splat_f32s(value), sum);
                }
                *to = simd.div_f32s(sum, total);
            }
            for (row, values) in mixed[..block].chunks_exact(side).enumerate() {
                for (column, value) in values.iter().enumerate() {
                    let at = step.out.at(side * x + column, side * y + row);
                    // SAFETY: a pixel of the output; a row of blocks is used by this task only.
                    unsafe { arena.write(at, 1)[0] = E::of(*value) };
                }
            }
        }
    }
}
