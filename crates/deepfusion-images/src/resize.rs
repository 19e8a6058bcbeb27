//! Resizes images, as pixels and as a network's input.

use deepfusion_kernels::Filter;
use image::RgbImage;
use std::cell::RefCell;

/// Resizes with a Lanczos filter of three lobes, antialiased when shrinking, half-pixel centres, like
/// PIL's `LANCZOS`, to one grey level. If `width` or `height` is 0, the image is empty.
#[must_use]
pub fn resize_rgb(image: &RgbImage, width: u32, height: u32) -> RgbImage {
    if image.dimensions() == (width, height) {
        return image.clone();
    }
    let mut resized = RgbImage::new(width, height);
    with_resizer(|resizer| {
        let pixels = resizer.resize(image, whole_image(image), width, height);
        resized.copy_from_slice(pixels);
    });
    resized
}

/// The image as 3×H×W floats in [0, 1], channel by channel.
#[must_use]
pub fn to_chw(image: &RgbImage) -> Vec<f32> {
    planes(image.as_raw())
}

/// A part of the image (x, y, width, height) as the network's input: 3×`height`×`width` floats in [0, 1],
/// channel by channel, resized as [`resize_rgb`] does. Pixels outside the part are not used.
///
/// # Panics
/// If the part is not within the image.
#[must_use]
pub fn to_network_input(image: &RgbImage, part: [u32; 4], width: u32, height: u32) -> Vec<f32> {
    with_resizer(|resizer| planes(resizer.resize(image, part, width, height)))
}

/// The x, y, width and height of the whole image.
fn whole_image(image: &RgbImage) -> [u32; 4] {
    [0, 0, image.width(), image.height()]
}

/// One resizer per thread: its buffers are as large as the images, and allocating them for every
/// image took a tenth of the time.
fn with_resizer<T>(work: impl FnOnce(&mut Resizer) -> T) -> T {
    thread_local! {
        static RESIZER: RefCell<Resizer> = RefCell::default();
    }
    RESIZER.with_borrow_mut(work)
}

/// A resizer with the buffers it reuses.
#[derive(Default)]
struct Resizer {
    inner: deepfusion_kernels::Resizer,
    narrowed: Vec<u8>,
    resized: Vec<u8>,
}

impl Resizer {
    /// The resized part's bytes, H×W×3.
    fn resize(&mut self, image: &RgbImage, part: [u32; 4], width: u32, height: u32) -> &[u8] {
        let [_, _, w, h] = part;
        let bytes = 3 * width as usize * height as usize;
        self.resized.resize(bytes, 0);
        if bytes == 0 || w == 0 || h == 0 {
            self.resized.fill(0);
            return &self.resized;
        }
        // Columns first, then rows, as PIL does. Overshoot at edges is clamped after each pass, so the
        // other order differs by tens of levels beside high contrasts. A pass that changes nothing copies.
        self.narrowed.resize(3 * width as usize * h as usize, 0);
        let whole = (image.width(), image.height());
        let (inner, filter) = (&mut self.inner, Filter::Lanczos3);
        let first = (image.as_raw().as_slice(), whole, part);
        inner.resize(first, filter, (&mut self.narrowed, (width, h)));
        let second = (self.narrowed.as_slice(), (width, h), [0, 0, width, h]);
        inner.resize(second, filter, (&mut self.resized, (width, height)));
        &self.resized
    }
}

/// Interleaved RGB bytes as three planes of floats in [0, 1].
fn planes(rgb: &[u8]) -> Vec<f32> {
    let mut planes = vec![0.0; rgb.len()];
    let (red, rest) = planes.split_at_mut(rgb.len() / 3);
    let (green, blue) = rest.split_at_mut(rgb.len() / 3);
    // One loop over whole pixels: the compiler turns it into vector shuffles, which it cannot with a
    // stride of 3.
    for (((pixel, r), g), b) in rgb.chunks_exact(3).zip(red).zip(green).zip(blue) {
        *r = f32::from(pixel[0]) / 255.0;
        *g = f32::from(pixel[1]) / 255.0;
        *b = f32::from(pixel[2]) / 255.0;
    }
    planes
}
