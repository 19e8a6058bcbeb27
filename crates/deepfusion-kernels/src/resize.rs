//! Resizes RGB bytes. The filters are compiled in this crate only: each crate that called them would contain a megabyte of code.

use fast_image_resize::images::{TypedCroppedImage, TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions};

/// How values between pixels are computed. Both have half-pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// Bilinear, from the nearest four pixels, without antialiasing.
    Bilinear,
    /// Lanczos with three lobes, with antialiasing when shrinking.
    Lanczos3,
}

/// Resizes RGB bytes, reusing its buffers.
#[derive(Debug, Default)]
pub struct Resizer(fast_image_resize::Resizer);

impl Resizer {
    /// Resizes a part (x, y, width, height) of `from`, H×W×3 bytes of an image of `size` (width, height), to `to`, an image of `to_size`.
    ///
    /// # Panics
    /// If a number of bytes does not match its size, the part extends beyond the image, or anything is empty.
    #[expect(clippy::expect_used, reason = "documented")]
    pub fn resize(
        &mut self,
        (from, size, part): (&[u8], (u32, u32), [u32; 4]),
        filter: Filter,
        (to, to_size): (&mut [u8], (u32, u32)),
    ) {
        let algorithm = match filter {
            Filter::Bilinear => ResizeAlg::Interpolation(FilterType::Bilinear),
            Filter::Lanczos3 => ResizeAlg::Convolution(FilterType::Lanczos3),
        };
        let whole = TypedImageRef::<U8x3>::from_buffer(size.0, size.1, from)
            .expect("the image has width x height x 3 bytes");
        let [x, y, width, height] = part;
        let part = TypedCroppedImage::new(whole, x, y, width, height)
            .expect("the part is within the image");
        let mut to = TypedImage::<U8x3>::from_buffer(to_size.0, to_size.1, to)
            .expect("the result has width x height x 3 bytes");
        // Not `resize`, which compiles code for all pixel types and takes minutes.
        self.0
            .resize_typed(&part, &mut to, &ResizeOptions::new().resize_alg(algorithm))
            .expect("it fails only for empty images, and neither is empty");
    }
}
