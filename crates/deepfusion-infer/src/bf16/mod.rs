//! Convolutions in bf16, on the matrix unit (AMX) or with AVX-512's dot products of pairs.

mod amx;
mod dot;
mod head;
mod winograd;

use std::arch::x86_64::{
    __m256bh, __m256i, __m512, _mm256_loadu_si256, _mm256_storeu_si256, _mm512_add_ps,
    _mm512_castsi512_ps, _mm512_cvtepu16_epi32, _mm512_cvtneps_pbh, _mm512_loadu_ps,
    _mm512_slli_epi32,
};
use std::mem::transmute;

use pulp::x86::V4;

use crate::Activation;
use crate::conv::Geometry;
use crate::element::Bf16;
use crate::tile::LANES;
use crate::view::Shared;

pub(crate) use amx::Amx;
pub(crate) use dot::Dot;
pub(crate) use head::HeadDot;
pub(crate) use winograd::WinogradDot;

/// Whether the processor multiplies pairs of bf16 (AVX512-BF16).
pub(crate) fn has_dot() -> bool {
    V4::try_new().is_some() && is_x86_feature_detected!("avx512bf16")
}

/// Whether the processor has the matrix unit and the system allows this process to use it.
pub(crate) fn has_amx() -> bool {
    has_dot() && deepfusion_kernels::matrix_unit::available()
}

/// Offsets of an output pixel and of its residual.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OutputPixel {
    out: usize,
    residual: usize,
}

impl OutputPixel {
    pub(crate) fn new(g: &Geometry, x: usize, y: usize) -> Self {
        Self {
            out: g.out.at(x, y),
            residual: g.residual.as_ref().map_or(0, |view| view.at(x, y)),
        }
    }
}

/// The last steps for a pixel's sums: bias, residual and activation, rounded to bf16.
pub(crate) struct Epilogue<'a> {
    simd: V4,
    geometry: &'a Geometry,
    bias: &'a [f32],
    arena: Shared<'a, Bf16>,
}

impl<'a> Epilogue<'a> {
    /// # Panics
    /// Without AVX-512; [`has_dot`] must be true.
    #[expect(
        clippy::expect_used,
        reason = "checked before a bf16 engine is created"
    )]
    pub(crate) fn new(geometry: &'a Geometry, bias: &'a [f32], arena: Shared<'a, Bf16>) -> Self {
        let simd = V4::try_new();
        Self {
            simd: simd.expect("AVX512-BF16 implies AVX-512, and the engine checked it"),
            geometry,
            bias,
            arena,
        }
    }

    /// Finishes sixteen channels from `c` on.
    ///
    /// # Safety
    /// The place's pixel must be used by this thread only, and nobody may write its residual; `sums` must have 16 values; [`has_dot`] must
    /// be true.
    #[inline]
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    pub(crate) unsafe fn channels(&self, place: OutputPixel, c: usize, sums: *const f32) {
        // SAFETY: sixteen values; the rest is guaranteed by the caller.
        unsafe { self.vector(place, c, _mm512_loadu_ps(sums)) };
    }

    /// Like [`Self::channels`], with the sums in a register.
    ///
    /// # Safety
    /// As for [`Self::channels`].
    #[inline]
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    pub(crate) unsafe fn vector(&self, place: OutputPixel, c: usize, sums: __m512) {
        let bias = &self.bias[c..][..LANES];
        // SAFETY: sixteen values of the bias and, as `at` checks, of the arena; the rest is guaranteed by the caller. Vectors of the same
        // size are arrays of the same numbers, whichever crate defines them.
        unsafe {
            let bias = _mm512_loadu_ps(bias.as_ptr());
            let mut sum = _mm512_add_ps(sums, bias);
            if self.geometry.residual.is_some() {
                let bits = _mm256_loadu_si256(self.arena.at(place.residual + c, LANES).cast());
                let bits = _mm512_slli_epi32::<16>(_mm512_cvtepu16_epi32(bits));
                sum = _mm512_add_ps(sum, _mm512_castsi512_ps(bits));
            }
            let sum = transmute::<__m512, pulp::f32x16>(sum);
            let value = self.geometry.activation.of(self.simd, sum);
            let value = transmute::<pulp::f32x16, __m512>(value);
            let rounded = transmute::<__m256bh, __m256i>(_mm512_cvtneps_pbh(value));
            _mm256_storeu_si256(self.arena.at(place.out + c, LANES).cast(), rounded);
        }
    }

    /// The single channel of up to sixteen pixels, kept in f32.
    ///
    /// # Safety
    /// As for [`Self::channels`].
    #[inline]
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn results(&self, places: &[Option<OutputPixel>], sums: impl Fn(usize) -> f32) {
        let mut values = [0.0_f32; LANES];
        for (p, value) in values.iter_mut().enumerate().take(places.len()) {
            *value = sums(p) + self.bias[0];
        }
        let activation: Activation = self.geometry.activation;
        // SAFETY: sixteen values.
        unsafe { activation.apply(self.simd, values.as_mut_ptr(), LANES) };
        for (place, value) in places.iter().zip(values) {
            if let Some(place) = place {
                let slots = self
                    .arena
                    .at(place.out, size_of::<f32>() / size_of::<Bf16>());
                // SAFETY: the layout has reserved the size of an f32 for the pixel, and it is used by this thread only.
                unsafe { slots.cast::<f32>().write_unaligned(value) };
            }
        }
    }
}
