//! The product over pixel pairs.

use super::{COLUMNS, ROWS, Unit};

/// `out[c·taps + t][o] += Σ_q source[c·plane_len + offsets[t] + q] · grad[q][o]`, both factors bf16.
pub(in super::super) struct PixelPairs<'a> {
    /// Offset of each tap in the first channel.
    pub(in super::super) offsets: &'a [usize],
    /// Distance from one channel to the next.
    pub(in super::super) plane_len: usize,
    /// Number of channels, a multiple of [`ROWS`].
    pub(in super::super) channels: usize,
    pub(in super::super) source: &'a [u16],
    /// Number of pixels, a multiple of [`COLUMNS`].
    pub(in super::super) pixels: usize,
    /// `pixels / 2` × `outputs` words of two pixels.
    pub(in super::super) grad: &'a [u32],
    /// Number of outputs, a multiple of [`ROWS`].
    pub(in super::super) outputs: usize,
    /// (`channels` · `offsets.len()`) × `outputs`.
    pub(in super::super) out: &'a mut [f32],
}

impl PixelPairs<'_> {
    pub(in super::super) fn run(self, unit: Unit) {
        assert_eq!(self.pixels % COLUMNS, 0, "pixels are whole blocks");
        assert_eq!(self.channels % ROWS, 0, "channels are whole tiles");
        assert_eq!(self.outputs % ROWS, 0, "outputs are whole tiles");
        assert_eq!(
            self.grad.len(),
            self.pixels / 2 * self.outputs,
            "gradient length"
        );
        assert_eq!(
            self.out.len(),
            self.channels * self.offsets.len() * self.outputs,
            "output length"
        );
        let last = self.offsets.iter().max().copied().unwrap_or(0);
        let last = last + self.channels.saturating_sub(1) * self.plane_len;
        assert!(self.source.len() >= last + self.pixels, "source length");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: all bounds were just checked, and the processor has the `Unit`.
        unsafe {
            match unit {
                Unit::Matrix => super::matrix::pixels(self),
                Unit::Dot => super::dot::pixels(self),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        unreachable!("no {unit:?} on this processor");
    }
}
