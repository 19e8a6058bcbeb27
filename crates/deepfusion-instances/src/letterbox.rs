//! Fits an image into a model's input, keeping its aspect ratio.

use deepfusion_kernels::{Filter, Resizer};
use image::RgbImage;

/// Grey value of the parts that the image does not fill.
const GREY: u8 = 114;

/// A model's colour format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colours {
    /// Red, green, blue from 0 to 1; the image in the middle of the input (YOLO).
    RgbToOne,
    /// Blue, green, red from 0 to 255; the image in the upper left of the input (YOLOX).
    Bgr,
}

/// The position of an image in a model's input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Letterbox {
    /// Size of the input, width and height.
    pub input: [usize; 2],
    /// Size of the image.
    pub image: [usize; 2],
    /// Pixels of the input per pixel of the image, to the right and down. They may differ a little, because the image's size in the input
    /// is rounded.
    pub scale: [f32; 2],
    /// The image's upper left corner in the input.
    pub offset: [f32; 2],
    /// Size of the image within the input.
    inner: [usize; 2],
}

impl Letterbox {
    /// The letterbox of an image of this width and height.
    #[must_use]
    pub fn new(image: [usize; 2], input: [usize; 2], colours: Colours) -> Self {
        let scale = (0..2)
            .map(|i| input[i] as f32 / image[i].max(1) as f32)
            .fold(f32::INFINITY, f32::min);
        let inner = [0, 1].map(|i| {
            let size = (image[i] as f32 * scale).round() as usize;
            size.clamp(1, input[i].max(1))
        });
        let offset = [0, 1].map(|i| match colours {
            // An odd pixel is added to the right and below.
            Colours::RgbToOne => ((input[i] - inner[i]) / 2) as f32,
            Colours::Bgr => 0.0,
        });
        Self {
            input,
            image,
            scale: [0, 1].map(|i| inner[i] as f32 / image[i].max(1) as f32),
            offset,
            inner,
        }
    }

    /// Maps a point of the input to the image.
    #[must_use]
    pub fn to_image(&self, place: [f32; 2]) -> [f32; 2] {
        [0, 1].map(|i| (place[i] - self.offset[i]) / self.scale[i])
    }

    /// Maps a point of the image to the input.
    #[must_use]
    pub fn to_input(&self, place: [f32; 2]) -> [f32; 2] {
        [0, 1].map(|i| place[i] * self.scale[i] + self.offset[i])
    }

    /// The first and the last cell along an axis that lie on the image; `cell` is the cells' width in pixels of the input.
    pub(crate) fn cells_of_image(&self, axis: usize, cell: f32) -> [f32; 2] {
        let first = (self.offset[axis] / cell).ceil();
        let after = ((self.offset[axis] + self.inner[axis] as f32) / cell).floor();
        [first, (after - 1.0).max(first)]
    }

    /// The model's input: 3×H×W values.
    #[must_use]
    pub fn fill(&self, image: &RgbImage, colours: Colours) -> Vec<f32> {
        let [width, height] = self.input;
        let (small, [inner_w, inner_h]) = (self.resized(image), self.inner);
        let most = match colours {
            Colours::RgbToOne => 255.0,
            Colours::Bgr => 1.0,
        };
        let mut input = vec![f32::from(GREY) / most; 3 * width * height];
        let (left, top) = (self.offset[0] as usize, self.offset[1] as usize);
        for (channel, plane) in input.chunks_exact_mut(width * height).enumerate() {
            let from = match colours {
                Colours::RgbToOne => channel,
                Colours::Bgr => 2 - channel,
            };
            for y in 0..inner_h {
                let row = &mut plane[(top + y) * width + left..][..inner_w];
                let pixels = &small[3 * y * inner_w..3 * (y + 1) * inner_w];
                for (value, pixel) in row.iter_mut().zip(pixels.chunks_exact(3)) {
                    *value = f32::from(pixel[from]) / most;
                }
            }
        }
        input
    }

    /// The image at its size in the input, bilinear without antialiasing, as in the training of these models.
    fn resized(&self, image: &RgbImage) -> Vec<u8> {
        let [width, height] = self.inner.map(|s| s as u32);
        let mut small = vec![0; 3 * width as usize * height as usize];
        let (w, h) = image.dimensions();
        if w > 0 && h > 0 {
            let from = (image.as_raw().as_slice(), (w, h), [0, 0, w, h]);
            Resizer::default().resize(from, Filter::Bilinear, (&mut small, (width, height)));
        }
        small
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn points_map_back_and_colours_keep_their_order() {
        let image = RgbImage::from_pixel(200, 100, Rgb([255, 0, 51]));
        let middle = Letterbox::new([200, 100], [64, 64], Colours::RgbToOne);
        assert_eq!((middle.scale, middle.offset), ([0.32; 2], [0.0, 16.0]));
        let place = [50.0, 75.0];
        let back = middle.to_image(middle.to_input(place));
        assert!((0..2).all(|i| (back[i] - place[i]).abs() < 1e-4));
        let input = middle.fill(&image, Colours::RgbToOne);
        let at = |c: usize, y: usize, x: usize| input[(c * 64 + y) * 64 + x];
        assert_eq!([at(0, 32, 0), at(1, 32, 63), at(2, 16, 5)], [1.0, 0.0, 0.2]);
        let grey = f32::from(GREY) / 255.0;
        assert_eq!([at(0, 15, 0), at(1, 48, 63), at(2, 63, 5)], [grey; 3]);

        let corner = Letterbox::new([200, 100], [64, 64], Colours::Bgr);
        assert_eq!(corner.offset, [0.0, 0.0]);
        let input = corner.fill(&image, Colours::Bgr);
        let at = |c: usize, y: usize, x: usize| input[(c * 64 + y) * 64 + x];
        assert_eq!(
            [at(0, 0, 0), at(2, 31, 63), at(0, 32, 0)],
            [51.0, 255.0, 114.0]
        );
    }
}
