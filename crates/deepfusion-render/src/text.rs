use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::mono_font::iso_8859_1::{FONT_6X10, FONT_7X13, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{Dimensions, DrawTarget, Drawable, Point, RgbColor, Size};
use embedded_graphics::primitives::Rectangle;
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage};

/// Size of drawn text: the sizes of the bitmap font.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextSize {
    /// 6×10 pixels per letter.
    Small,
    /// 7×13 pixels per letter.
    Medium,
    /// 10×20 pixels per letter.
    Large,
}

impl TextSize {
    /// The size that suits a picture of this width.
    #[must_use]
    pub fn for_width(width: u32) -> Self {
        match width {
            0..400 => Self::Small,
            400..1000 => Self::Medium,
            _ => Self::Large,
        }
    }

    /// Height of a line, in pixels.
    #[must_use]
    pub fn height(self) -> u32 {
        self.font().character_size.height
    }

    fn font(self) -> &'static MonoFont<'static> {
        match self {
            Self::Small => &FONT_6X10,
            Self::Medium => &FONT_7X13,
            Self::Large => &FONT_10X20,
        }
    }
}

/// Width of a line of text, in pixels.
#[must_use]
pub fn text_width(text: &str, size: TextSize) -> u32 {
    text.chars().count() as u32 * size.font().character_size.width
}

/// Draws a line of text (Latin letters) with its top left corner at (`x`, `y`); parts outside the picture are cut off.
pub fn draw_text(
    picture: &mut RgbImage,
    text: &str,
    (x, y): (i32, i32),
    size: TextSize,
    colour: Rgb<u8>,
) {
    let [r, g, b] = colour.0;
    let style = MonoTextStyle::new(size.font(), Rgb888::new(r, g, b));
    let text = Text::with_baseline(text, Point::new(x, y), style, Baseline::Top);
    // Drawing into memory cannot fail.
    let _: std::result::Result<Point, Infallible> = text.draw(&mut Canvas(picture));
}

struct Canvas<'a>(&'a mut RgbImage);

impl Dimensions for Canvas<'_> {
    fn bounding_box(&self) -> Rectangle {
        Rectangle::new(Point::zero(), Size::new(self.0.width(), self.0.height()))
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> std::result::Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y))
                && let Some(pixel) = self.0.get_pixel_mut_checked(x, y)
            {
                *pixel = Rgb([colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_inside_its_box_and_the_picture() {
        let mut picture = RgbImage::new(60, 20);
        draw_text(
            &mut picture,
            "80 m",
            (5, 4),
            TextSize::Medium,
            Rgb([255, 255, 255]),
        );
        let lit: Vec<(u32, u32)> = picture
            .enumerate_pixels()
            .filter(|(_, _, p)| p.0[0] > 0)
            .map(|(x, y, _)| (x, y))
            .collect();
        assert!(lit.len() > 20);
        let right = 5 + text_width("80 m", TextSize::Medium);
        assert!(
            lit.iter()
                .all(|(x, y)| (5..right).contains(x) && (4..17).contains(y))
        );
        draw_text(
            &mut picture,
            "cut off",
            (-10, 15),
            TextSize::Large,
            Rgb([255, 255, 255]),
        );
    }
}
