//! RGB bytes of another size. The filters are compiled here alone: they are a megabyte of code in each crate that calls them.

use fast_image_resize::images::{TypedCroppedImage, TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions};

/// How pixels between pixels are found. Both have half-pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// From the nearest four, antialiased by nothing.
    Bilinear,
    /// Lanczos of three lobes, antialiased when shrinking.
    Lanczos3,
}

/// Resizes RGB bytes, with the buffers that it reuses.
#[derive(Debug, Default)]
pub struct Resizer(fast_image_resize::Resizer);

impl Resizer {
    /// Brings a part (x, y, width, height) of `from`, H×W×3 bytes of an image of `size` (width, height), to `to`, which has
    /// `to_size`.
    ///
    /// # Panics
    /// Where the bytes are not as many as the sizes say, the part reaches out of the image, or anything is empty.
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
            .expect("the image holds width x height x 3 bytes");
        let [x, y, width, height] = part;
        let part =
            TypedCroppedImage::new(whole, x, y, width, height).expect("the part lies in the image");
        let mut to = TypedImage::<U8x3>::from_buffer(to_size.0, to_size.1, to)
            .expect("the result holds width x height x 3 bytes");
        // Not `resize`: that one compiles every pixel type there is, for minutes.
        self.0
            .resize_typed(&part, &mut to, &ResizeOptions::new().resize_alg(algorithm))
            .expect("neither image is empty, the only reason to refuse");
    }
}
