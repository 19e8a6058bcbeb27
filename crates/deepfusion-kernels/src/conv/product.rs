//! The inner loop of convolutions in f32: a small block of outputs kept in registers.
//!
//! A convolution's forward pass and both its gradients are sums over products of a number (from a row) and a vector of neighbouring numbers
//! (from the columns). They differ only in where the two are read:
//!
//! | | rows | columns | summed over |
//! |---|---|---|---|
//! | forward, input gradient | weights of an output channel | neighbouring pixels | taps (c, ky, kx) |
//! | weight gradient | one tap's pixels | neighbouring output channels | pixels |
//!
//! Reading through tables of offsets makes im2col unnecessary: in a padded image, the pixels that a tap reads are the same image, shifted.

use pulp::{Arch, Simd, WithSimd};

/// Columns are a multiple of this, the lanes of the widest vectors. Buffers are padded to it.
pub(super) const LANES: usize = 16;
/// Taps summed before the partial sums are written to memory, so that their weights stay in the L1 cache.
const TAPS_AT_ONCE: usize = 288;
/// Pixels summed at once by the weight gradient, for the same reason.
const PIXELS_AT_ONCE: usize = 128;

/// `count` rounded up to whole vectors.
pub(super) fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// `out[m][q] = Σ_k weights[m][k] · source[offsets[k] + q]`
pub(super) struct TapProduct<'a> {
    /// Rows of at least `offsets.len()` weights.
    pub(super) weights: &'a [f32],
    /// Distance between the rows of `weights`.
    pub(super) weight_stride: usize,
    /// Offset of each tap.
    pub(super) offsets: &'a [usize],
    pub(super) source: &'a [f32],
    /// Number of columns, a multiple of [`LANES`].
    pub(super) columns: usize,
    /// `rows` × `columns`, overwritten.
    pub(super) out: &'a mut [f32],
    pub(super) rows: usize,
}

/// `out[t][o] += Σ_i source[offsets[t] + pixels[i]] · grad[i][o]`
pub(super) struct PixelProduct<'a> {
    /// Offset of each tap.
    pub(super) offsets: &'a [usize],
    pub(super) source: &'a [f32],
    /// Offset of each pixel in the source.
    pub(super) pixels: &'a [usize],
    /// `pixels.len()` × `columns`.
    pub(super) grad: &'a [f32],
    /// Number of columns, a multiple of [`LANES`].
    pub(super) columns: usize,
    /// `offsets.len()` × `columns`.
    pub(super) out: &'a mut [f32],
}

impl TapProduct<'_> {
    pub(super) fn run(self) {
        assert_eq!(self.columns % LANES, 0, "columns are whole vectors");
        assert_eq!(self.out.len(), self.rows * self.columns, "output length");
        assert!(self.weight_stride >= self.offsets.len(), "row of weights");
        assert!(
            self.weights.len() >= (self.rows - 1) * self.weight_stride + self.offsets.len(),
            "weights"
        );
        let last = self.offsets.iter().max().map_or(0, |o| o + self.columns);
        assert!(self.source.len() >= last, "source length");
        Arch::new().dispatch(self);
    }
}

impl PixelProduct<'_> {
    pub(super) fn run(self) {
        assert_eq!(self.columns % LANES, 0, "columns are whole vectors");
        assert_eq!(self.out.len(), self.offsets.len() * self.columns, "output");
        assert_eq!(self.grad.len(), self.pixels.len() * self.columns, "grad");
        let last = |v: &[usize]| v.iter().max().copied().unwrap_or(0);
        assert!(
            self.source.len() > last(self.offsets) + last(self.pixels),
            "source length"
        );
        Arch::new().dispatch(self);
    }
}

/// Pointers and flags of a block.
#[derive(Clone, Copy)]
struct Block {
    columns: *const f32,
    out: *mut f32,
    out_stride: usize,
    /// Whether to add to the content of `out`.
    add: bool,
}

/// `out[m][j] (+)= Σ_{i < n} *rows[m][row_at(i)] · columns[column_at(i) + j]` for `ROWS` rows and `VECTORS`
/// vectors of columns, summed in registers.
///
/// # Safety
/// Everything read and written must be in bounds.
#[inline(always)]
unsafe fn block<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    n: usize,
    rows: [*const f32; ROWS],
    row_at: impl Fn(usize) -> usize,
    column_at: impl Fn(usize) -> usize,
    at: Block,
) {
    let zero = simd.splat_f32s(0.0);
    let mut sums = [[zero; VECTORS]; ROWS];
    // SAFETY: guaranteed by the caller.
    unsafe {
        for i in 0..n {
            let from = at.columns.add(column_at(i)).cast::<S::f32s>();
            let mut vectors = [zero; VECTORS];
            for v in 0..VECTORS {
                vectors[v] = from.add(v).read_unaligned();
            }
            let step = row_at(i);
            for m in 0..ROWS {
                let factor = simd.splat_f32s(*rows[m].add(step));
                for v in 0..VECTORS {
                    sums[m][v] = simd.mul_add_f32s(factor, vectors[v], sums[m][v]);
                }
            }
        }
        for m in 0..ROWS {
            let to = at.out.add(m * at.out_stride).cast::<S::f32s>();
            for v in 0..VECTORS {
                let mut sum = sums[m][v];
                if at.add {
                    sum = simd.add_f32s(sum, to.add(v).read_unaligned());
                }
                to.add(v).write_unaligned(sum);
            }
        }
    }
}

/// Number of rows of a block, if that many are left.
fn most_rows<S: Simd>() -> usize {
    if S::REGISTER_COUNT >= 32 { 8 } else { 4 }
}

/// Number of rows of the next block if `left` are left: blocks of `most`, then of 4, 2 and 1.
fn rows_at_once(left: usize, most: usize) -> usize {
    match left {
        _ if left >= most => most,
        4.. => 4,
        2.. => 2,
        _ => 1,
    }
}

/// Number of vectors of the next block if `left` are left: blocks of 3, ending with 2 + 2 rather than 3 + 1.
fn vectors_at_once(left: usize) -> usize {
    match left {
        4 => 2,
        3.. => 3,
        left => left,
    }
}

/// Calls `$call` with constants for the block's size.
macro_rules! with_size {
    ($rows:expr, $vectors:expr, |$R:ident, $V:ident| $call:expr) => {
        with_size!(@rows $rows, $vectors, $R, $V, $call; 8 4 2 1)
    };
    (@rows $rows:expr, $vectors:expr, $R:ident, $V:ident, $call:expr; $($r:literal)*) => {
        match ($rows, $vectors) {
            $(
                ($r, 3) => { const $R: usize = $r; const $V: usize = 3; $call }
                ($r, 2) => { const $R: usize = $r; const $V: usize = 2; $call }
                ($r, 1) => { const $R: usize = $r; const $V: usize = 1; $call }
            )*
            _ => unreachable!("blocks have 8, 4, 2 or 1 rows of 1 to 3 vectors"),
        }
    };
}

/// Pointers to `ROWS` rows.
#[inline(always)]
fn pointers<const ROWS: usize>(at: impl Fn(usize) -> *const f32) -> [*const f32; ROWS] {
    let mut rows = [std::ptr::null(); ROWS];
    for (m, row) in rows.iter_mut().enumerate() {
        *row = at(m);
    }
    rows
}

impl WithSimd for TapProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            weights,
            weight_stride,
            offsets,
            source,
            columns,
            out,
            rows,
        } = self;
        let most = most_rows::<S>();
        for first in (0..offsets.len().max(1)).step_by(TAPS_AT_ONCE) {
            let taps =
                &offsets[first.min(offsets.len())..(first + TAPS_AT_ONCE).min(offsets.len())];
            let mut m = 0;
            while m < rows {
                let height = rows_at_once(rows - m, most);
                let mut q = 0;
                while q < columns {
                    let vectors = vectors_at_once((columns - q) / S::F32_LANES);
                    let at = Block {
                        columns: source.as_ptr().wrapping_add(q),
                        out: out.as_mut_ptr().wrapping_add(m * columns + q),
                        out_stride: columns,
                        add: first > 0,
                    };
                    let row = |r: usize| {
                        let row = weights.as_ptr();
                        row.wrapping_add((m + r) * weight_stride + first)
                    };
                    // SAFETY: bounds are asserted in `run`.
                    with_size!(height, vectors, |ROWS, VECTORS| unsafe {
                        block::<S, ROWS, VECTORS>(
                            simd,
                            taps.len(),
                            pointers::<ROWS>(row),
                            |i| i,
                            |i| *taps.get_unchecked(i),
                            at,
                        );
                    });
                    q += vectors * S::F32_LANES;
                }
                m += height;
            }
        }
    }
}

impl WithSimd for PixelProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            offsets,
            source,
            pixels,
            grad,
            columns,
            out,
        } = self;
        let most = most_rows::<S>();
        for first in (0..pixels.len()).step_by(PIXELS_AT_ONCE) {
            let part = &pixels[first..(first + PIXELS_AT_ONCE).min(pixels.len())];
            let mut o = 0;
            while o < columns {
                let vectors = vectors_at_once((columns - o) / S::F32_LANES);
                let mut t = 0;
                while t < offsets.len() {
                    let height = rows_at_once(offsets.len() - t, most);
                    let at = Block {
                        columns: grad.as_ptr().wrapping_add(first * columns + o),
                        out: out.as_mut_ptr().wrapping_add(t * columns + o),
                        out_stride: columns,
                        add: true,
                    };
                    let row = |r: usize| source.as_ptr().wrapping_add(offsets[t + r]);
                    // SAFETY: bounds are asserted in `run`.
                    with_size!(height, vectors, |ROWS, VECTORS| unsafe {
                        block::<S, ROWS, VECTORS>(
                            simd,
                            part.len(),
                            pointers::<ROWS>(row),
                            |i| *part.get_unchecked(i),
                            |i| i * columns,
                            at,
                        );
                    });
                    t += height;
                }
                o += vectors * S::F32_LANES;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise32 as noise;

    /// Numbers of rows, columns, taps and pixels that need blocks of every size and several rounds of sums.
    const ROWS: usize = 15;
    const COLUMNS: usize = 7 * LANES;
    const TAPS: usize = TAPS_AT_ONCE + 11;
    const PIXELS: usize = PIXELS_AT_ONCE + 9;

    /// The results of both products by `run`, one after the other.
    fn products(run: &dyn Fn(TapProduct, PixelProduct)) -> Vec<f32> {
        let source = noise(2 * TAPS + COLUMNS + 3 * PIXELS, 1);
        let weights = noise(ROWS * (TAPS + 3), 2);
        let grad = noise(PIXELS * COLUMNS, 3);
        let offsets: Vec<usize> = (0..TAPS).map(|k| (k * 7) % (2 * TAPS)).collect();
        let pixels: Vec<usize> = (0..PIXELS).map(|i| 3 * i).collect();
        let (mut out, mut sums) = (vec![7.0; ROWS * COLUMNS], noise(ROWS * COLUMNS, 4));
        let by_taps = TapProduct {
            weights: &weights,
            weight_stride: TAPS + 3,
            offsets: &offsets,
            source: &source,
            columns: COLUMNS,
            out: &mut out,
            rows: ROWS,
        };
        let by_pixels = PixelProduct {
            offsets: &offsets[..ROWS],
            source: &source,
            pixels: &pixels,
            grad: &grad,
            columns: COLUMNS,
            out: &mut sums,
        };
        run(by_taps, by_pixels);
        out.extend(sums);
        out
    }

    fn on<S: Simd>(simd: S) -> Vec<f32> {
        products(&|by_taps, by_pixels| {
            simd.vectorize(by_taps);
            simd.vectorize(by_pixels);
        })
    }

    /// The width of the vectors determines how many sums are computed at once, but not their order, so every instruction set with fused
    /// multiply-add gives the same bits.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let dispatched = products(&|by_taps, by_pixels| {
            by_taps.run();
            by_pixels.run();
        });
        assert!(dispatched.iter().all(|v| v.is_finite()));
        assert!(on(pulp::Scalar::new()) == dispatched, "scalar");
        #[cfg(target_arch = "x86_64")]
        {
            let v3 = pulp::x86::V3::try_new().map(on);
            assert!(v3.is_none_or(|v3| v3 == dispatched), "AVX2");
            let v4 = pulp::x86::V4::try_new().map(on);
            assert!(v4.is_none_or(|v4| v4 == dispatched), "AVX-512");
        }
    }
}
