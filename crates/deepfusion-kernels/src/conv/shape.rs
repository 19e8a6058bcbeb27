use super::arithmetic::Arithmetic;
use super::bf16::Precision;
use super::lattice::{Lattice, Window};
use crate::sizes::product;
use std::ops::Range;

/// The sizes of a convolution. Images are N×C×H×W, weights O×C×kh×kw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConvShape {
    /// Number of images, N.
    pub batch: usize,
    /// Input channels, C.
    pub in_channels: usize,
    /// Input height, H.
    pub in_height: usize,
    /// Input width, W.
    pub in_width: usize,
    /// Output channels, O.
    pub out_channels: usize,
    /// Kernel height, kh.
    pub kernel_height: usize,
    /// Kernel width, kw.
    pub kernel_width: usize,
    /// Step between output pixels, on both axes.
    pub stride: usize,
    /// Rows and columns of padding on each side.
    pub padding: usize,
    /// Step between kernel taps, on both axes.
    pub dilation: usize,
    /// Whether padding mirrors the image (without repeating its edge) instead of being zero.
    pub reflect: bool,
    /// Precision of the products.
    pub precision: Precision,
}

impl ConvShape {
    /// Output height: ⌊(H + 2p − d(kh − 1) − 1)/s⌋ + 1.
    #[must_use]
    pub fn out_height(&self) -> usize {
        self.out_size(self.in_height, self.kernel_height)
    }

    /// Output width: ⌊(W + 2p − d(kw − 1) − 1)/s⌋ + 1.
    #[must_use]
    pub fn out_width(&self) -> usize {
        self.out_size(self.in_width, self.kernel_width)
    }

    #[expect(clippy::expect_used, reason = "an image in memory")]
    fn out_size(&self, size: usize, kernel: usize) -> usize {
        let padded = self.padding.checked_mul(2);
        let padded = padded.and_then(|p| size.checked_add(p));
        let padded = padded.expect("an image with its padding can be counted");
        let reach = product([self.dilation, kernel - 1]);
        padded
            .checked_sub(reach)
            .and_then(|rest| rest.checked_sub(1))
            .map_or(0, |span| span / self.stride + 1)
    }

    /// Number of weights of one output channel: K = C·kh·kw.
    pub(crate) fn taps(&self) -> usize {
        product([self.in_channels, self.kernel_height, self.kernel_width])
    }

    pub(crate) fn kernel_area(&self) -> usize {
        product([self.kernel_height, self.kernel_width])
    }

    pub(crate) fn out_area(&self) -> usize {
        product([self.out_height(), self.out_width()])
    }

    pub(crate) fn in_area(&self) -> usize {
        product([self.in_height, self.in_width])
    }

    /// Distance between the first and the last tap, down and right.
    pub(super) fn reach(&self) -> (usize, usize) {
        (
            (self.kernel_height - 1) * self.dilation,
            (self.kernel_width - 1) * self.dilation,
        )
    }

    /// The taps of one channel, each as its distance (down, right) from the first.
    pub(super) fn kernel_taps(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (height, width, step) = (self.kernel_height, self.kernel_width, self.dilation);
        (0..height).flat_map(move |y| (0..width).map(move |x| (y * step, x * step)))
    }

    /// How the kernel samples the input.
    pub(super) fn window(&self) -> Window {
        Window {
            height: self.in_height,
            width: self.in_width,
            padding: (self.padding, self.padding),
            reflect: self.reflect,
            stride: self.stride,
            reach: self.reach(),
            out_width: self.out_width(),
        }
    }

    /// Offsets of the taps of channels `channels`, given these channels' planes one after the other.
    pub(super) fn tap_offsets(&self, lattice: &Lattice, channels: Range<usize>) -> Vec<usize> {
        let of_channel: Vec<usize> = self.kernel_taps().map(|t| lattice.offset(t)).collect();
        channels
            .flat_map(|c| of_channel.iter().map(move |o| c * lattice.plane_len + o))
            .collect()
    }

    /// Number of input values.
    ///
    /// # Panics
    /// If the number overflows.
    #[must_use]
    pub fn in_len(&self) -> usize {
        product([self.batch, self.in_channels, self.in_area()])
    }

    /// Number of output values.
    ///
    /// # Panics
    /// As for [`Self::in_len`].
    #[must_use]
    pub fn out_len(&self) -> usize {
        product([self.batch, self.out_channels, self.out_area()])
    }

    /// Number of weights.
    ///
    /// # Panics
    /// As for [`Self::in_len`].
    #[must_use]
    pub fn weight_len(&self) -> usize {
        product([self.out_channels, self.taps()])
    }

    /// Multiply-adds of the forward pass; each gradient costs as many.
    ///
    /// # Panics
    /// As for [`Self::in_len`].
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        product([self.batch, self.out_area(), self.weight_len()])
    }

    /// Whether Winograd's form can compute it: 3×3 with a margin of one pixel, at stride 1, in f32.
    pub(super) fn is_plain_3x3(&self) -> bool {
        (self.kernel_height, self.kernel_width) == (3, 3)
            && (self.stride, self.dilation, self.padding) == (1, 1, 1)
            && Arithmetic::of(self) == Arithmetic::Single
    }

    /// # Panics
    /// If reflection needs more rows or columns than the image has.
    pub(crate) fn check(&self) {
        assert!(
            self.stride > 0 && self.dilation > 0 && self.kernel_area() > 0,
            "stride, dilation and kernel are at least 1"
        );
        assert!(
            !self.reflect
                || (self.padding < self.in_height.max(1) && self.padding < self.in_width.max(1)),
            "reflection padding of {} needs an image larger than {}x{}",
            self.padding,
            self.in_height,
            self.in_width
        );
    }
}
