//! The inner loop in f32: a few pixels by a few vectors of output channels, kept in registers.

use pulp::Simd;

/// Channels are padded to a multiple of this, the lanes of the widest vectors.
pub(crate) const LANES: usize = 16;
/// Output channels whose weights are stored together, one row for every input.
pub(crate) const GROUP: usize = 64;

/// The terms of a tile of outputs: `out[r][o] = Σ_run Σ_k input[r][run + k] · panel[k'][o]`.
#[derive(Clone, Copy)]
pub(crate) struct Sum<'a> {
    /// Start of each run of inputs, relative to a pixel.
    pub(crate) runs: &'a [usize],
    /// Contiguous inputs in a run.
    pub(crate) len: usize,
    /// A row of `stride` weights for each input of each run.
    pub(crate) panel: *const f32,
    /// Weights in a row of the panel.
    pub(crate) stride: usize,
    /// Initial value of the sum.
    pub(crate) start: Start,
    /// Whether negative sums become 0 at the end.
    pub(crate) relu: bool,
}

/// Initial value of a sum.
#[derive(Clone, Copy)]
pub(crate) enum Start {
    Zero,
    /// The current content of `out`.
    Out,
    /// A value for each output channel.
    Bias(*const f32),
    /// A value for each output channel, and each pixel's residual.
    BiasAndResidual(*const f32),
}

impl Start {
    fn moved(self, column: usize) -> Self {
        match self {
            Self::Bias(bias) => Self::Bias(bias.wrapping_add(column)),
            Self::BiasAndResidual(bias) => Self::BiasAndResidual(bias.wrapping_add(column)),
            other => other,
        }
    }
}

/// Pointers to one pixel's inputs and outputs.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) input: *const f32,
    pub(crate) out: *mut f32,
    /// Read only if the sum starts at the residual.
    pub(crate) residual: *const f32,
}

/// # Safety
/// Everything that the sum refers to must be readable, and all of `out` writable.
#[inline(always)]
unsafe fn tile<S: Simd, const R: usize, const V: usize>(
    simd: S,
    sum: &Sum,
    pixels: &[Pixel],
    shift: Shift,
) {
    // Short loops without inner branches: the compiler unrolls all of them and keeps `sums` in registers.
    let zero = simd.splat_f32s(0.0);
    let mut sums = [[zero; V]; R];
    let mut inputs = [std::ptr::null::<f32>(); R];
    for (input, pixel) in inputs.iter_mut().zip(pixels) {
        *input = pixel.input.wrapping_add(shift.input);
    }
    // SAFETY: guaranteed by the caller.
    unsafe {
        let load = |from: *const f32, v: usize| from.cast::<S::f32s>().add(v).read_unaligned();
        match sum.start {
            Start::Zero => {}
            Start::Out => {
                for r in 0..R {
                    for v in 0..V {
                        sums[r][v] = load(pixels.get_unchecked(r).out.add(shift.out), v);
                    }
                }
            }
            Start::Bias(bias) => {
                for r in 0..R {
                    for v in 0..V {
                        sums[r][v] = load(bias, v);
                    }
                }
            }
            Start::BiasAndResidual(bias) => {
                for r in 0..R {
                    for v in 0..V {
                        let residual = load(pixels.get_unchecked(r).residual.add(shift.out), v);
                        sums[r][v] = simd.add_f32s(residual, load(bias, v));
                    }
                }
            }
        }
        let mut panel = sum.panel;
        for &run in sum.runs {
            for k in run..run + sum.len {
                let mut weights = [zero; V];
                for v in 0..V {
                    weights[v] = load(panel, v);
                }
                panel = panel.add(sum.stride);
                for r in 0..R {
                    let x = simd.splat_f32s(*inputs[r].add(k));
                    for v in 0..V {
                        sums[r][v] = simd.mul_add_f32s(x, weights[v], sums[r][v]);
                    }
                }
            }
        }
        let least = simd.splat_f32s(if sum.relu { 0.0 } else { f32::NEG_INFINITY });
        for r in 0..R {
            let out = pixels.get_unchecked(r).out.add(shift.out).cast::<S::f32s>();
            for v in 0..V {
                // In this order x86 keeps a NaN sum, as other processors do.
                out.add(v).write_unaligned(simd.max_f32s(least, sums[r][v]));
            }
        }
    }
}

/// Maximum number of vectors of a tile, given the registers.
fn most_vectors<S: Simd>() -> usize {
    if S::REGISTER_COUNT >= 32 { 4 } else { 2 }
}

/// Number of pixels of a tile with that many vectors: sums, weights and one input fill the registers.
fn most_pixels<S: Simd>(vectors: usize) -> usize {
    if S::REGISTER_COUNT >= 32 && vectors < 4 {
        8
    } else {
        6
    }
}

macro_rules! with_size {
    ($rows:expr, $vectors:expr, |$R:ident, $V:ident| $call:expr) => {
        with_size!(@rows $rows, $vectors, $R, $V, $call; 8 7 6 5 4 3 2 1)
    };
    (@rows $rows:expr, $vectors:expr, $R:ident, $V:ident, $call:expr; $($r:literal)*) => {
        match ($rows, $vectors) {
            $(
                ($r, 4) if $r <= 6 => { const $R: usize = if $r <= 6 { $r } else { 6 }; const $V: usize = 4; $call }
                ($r, 3) => { const $R: usize = $r; const $V: usize = 3; $call }
                ($r, 2) => { const $R: usize = $r; const $V: usize = 2; $call }
                ($r, 1) => { const $R: usize = $r; const $V: usize = 1; $call }
            )*
            _ => unreachable!("tiles have 1 to 8 pixels by 1 to 4 vectors"),
        }
    };
}

/// Offsets added to every pixel's pointers.
#[derive(Clone, Copy, Default)]
pub(crate) struct Shift {
    pub(crate) input: usize,
    /// Offset for `out` and `residual`.
    pub(crate) out: usize,
}

/// Computes the sum for all pixels and `columns` output channels (a multiple of [`LANES`], at most the panel's stride).
///
/// # Safety
/// Everything that the sum refers to must be readable, and all of the pixels' `out` writable, `columns` values each.
#[inline(always)]
pub(crate) unsafe fn tiles<S: Simd>(
    simd: S,
    sum: &Sum,
    columns: usize,
    pixels: &[Pixel],
    shift: Shift,
) {
    let mut column = 0;
    while column < columns {
        let vectors = ((columns - column) / S::F32_LANES).min(most_vectors::<S>());
        let part = Sum {
            panel: sum.panel.wrapping_add(column),
            start: sum.start.moved(column),
            ..*sum
        };
        let shift = Shift {
            out: shift.out + column,
            ..shift
        };
        for pixels in pixels.chunks(most_pixels::<S>(vectors)) {
            // SAFETY: guaranteed by the caller.
            with_size!(pixels.len(), vectors, |R, V| unsafe {
                tile::<S, R, V>(simd, &part, pixels, shift);
            });
        }
        column += vectors * S::F32_LANES;
    }
}
