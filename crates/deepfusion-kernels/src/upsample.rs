//! Nearest ×2 enlargement concatenated with a skip feature, as between the decoder's scales.

use crate::sizes::product;
use crate::slot::{Slot, filled, room};
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// out = [nearest×2(`x`); `skip`], along the channels.
///
/// # Shapes
/// `x` N×C×H×W, `skip` N×S×2H×2W (S may be 0), `out` N×(C + S)×2H×2W; `width` is W.
///
/// # Panics
/// If a length does not match.
pub fn upsample_concat(
    x: &[f32],
    skip: &[f32],
    batch: usize,
    channels: usize,
    width: usize,
    out: &mut [impl Slot],
) {
    assert_eq!(
        (x.len() % batch, skip.len() % batch),
        (0, 0),
        "whole images"
    );
    let (small, skip_image) = (x.len() / batch, skip.len() / batch);
    assert_eq!(small % product([channels, width]), 0, "whole planes");
    assert_eq!(out.len(), 4 * x.len() + skip.len(), "output length");
    let area = small / channels;
    room(out)
        .par_chunks_mut(4 * small + skip_image)
        .zip(x.par_chunks(small))
        .enumerate()
        .for_each(|(n, (out, x))| {
            let (large, rest) = out.split_at_mut(4 * small);
            large
                .par_chunks_mut(4 * area)
                .zip(x.par_chunks(area))
                .for_each(|(out, x)| {
                    for (rows, row) in out.chunks_exact_mut(4 * width).zip(x.chunks_exact(width)) {
                        let (top, bottom) = rows.split_at_mut(2 * width);
                        for (pair, v) in top.as_chunks_mut::<2>().0.iter_mut().zip(row) {
                            *pair = [MaybeUninit::new(*v); 2];
                        }
                        bottom.copy_from_slice(top);
                    }
                });
            rest.write_copy_of_slice(&skip[n * skip_image..][..skip_image]);
        });
}

/// Gradients of [`upsample_concat`].
///
/// # Shapes
/// `grad_out` N×(C + S)×2H×2W, `grad_x` N×C×H×W and `grad_skip` N×S×2H×2W, overwritten.
///
/// # Panics
/// If a length does not match.
pub fn upsample_concat_backward(
    grad_out: &[f32],
    batch: usize,
    channels: usize,
    width: usize,
    grad_x: &mut [impl Slot],
    grad_skip: &mut [impl Slot],
) {
    assert_eq!(
        (grad_x.len() % batch, grad_skip.len() % batch),
        (0, 0),
        "whole images"
    );
    let (small, skip_image) = (grad_x.len() / batch, grad_skip.len() / batch);
    assert_eq!(small % product([channels, width]), 0, "whole planes");
    assert_eq!(
        grad_out.len(),
        4 * grad_x.len() + grad_skip.len(),
        "output gradient length"
    );
    let image = 4 * small + skip_image;
    room(grad_x)
        .par_chunks_mut(small)
        .zip(grad_out.par_chunks(image))
        .for_each(|(grad_x, grad)| {
            grad_x
                .par_chunks_mut(width)
                .zip(grad[..4 * small].par_chunks(4 * width))
                .for_each(|(to, rows)| {
                    let (top, bottom) = rows.split_at(2 * width);
                    let pairs = top.as_chunks::<2>().0.iter().zip(bottom.as_chunks::<2>().0);
                    filled(to, pairs.map(|(t, b)| t[0] + t[1] + b[0] + b[1]));
                });
        });
    if skip_image > 0 {
        room(grad_skip)
            .par_chunks_mut(skip_image)
            .zip(grad_out.par_chunks(image))
            .for_each(|(to, grad)| {
                to.write_copy_of_slice(&grad[4 * small..]);
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_repeat_and_the_skip_follows() {
        let x = [1.0, 2.0, 3.0, 4.0];
        let skip: Vec<f32> = (10..26).map(|v| v as f32).collect();
        let mut out = vec![0.0; 32];
        upsample_concat(&x, &skip, 1, 1, 2, &mut out);
        assert_eq!(out[..8], [1.0, 1.0, 2.0, 2.0, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!(out[8..16], [3.0, 3.0, 4.0, 4.0, 3.0, 3.0, 4.0, 4.0]);
        assert_eq!(out[16..], skip[..]);
    }

    /// ⟨A·(x, s), g⟩ = ⟨(x, s), Aᵀ·g⟩.
    #[test]
    fn the_backward_pass_is_the_transpose() {
        let value = |i: usize| ((i * 37 % 23) as f32) - 11.0;
        let (batch, channels, width, height, skips) = (2, 3, 4, 2, 2);
        let x: Vec<f32> = (0..batch * channels * width * height).map(value).collect();
        let skip: Vec<f32> = (0..batch * skips * 4 * width * height).map(value).collect();
        let mut out = vec![0.0; 4 * x.len() + skip.len()];
        upsample_concat(&x, &skip, batch, channels, width, &mut out);
        let g: Vec<f32> = (0..out.len()).map(|i| value(i * 5 + 1)).collect();
        let (mut gx, mut gs) = (vec![7.0; x.len()], vec![7.0; skip.len()]);
        upsample_concat_backward(&g, batch, channels, width, &mut gx, &mut gs);
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        assert_eq!(dot(&out, &g), dot(&x, &gx) + dot(&skip, &gs));
    }
}
