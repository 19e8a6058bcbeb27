//! Access to an image's pixels by its encoding and step.

use super::{Image, LayoutProblem, MessageError, MessagePart, bayer, yuv};
use std::borrow::Cow;

/// The encodings that [`Image::to_rgb8`] reads.
const PICTURES: &str = "mono8, 8UC1, mono16, rgb8, bgr8, 8UC3, rgba8, bgra8, 8UC4, bayer_rggb8, bayer_bggr8, bayer_gbrg8, bayer_grbg8, \
     yuv422, uyvy, yuv422_yuy2, yuyv";
/// The other known encodings, besides [`PICTURES`].
const NUMBERS: &str = "16UC1, 32FC1, bayer_rggb16, bayer_bggr16, bayer_gbrg16, bayer_grbg16";

/// A Bayer pattern: the colours of the first row, then of the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BayerPattern {
    /// Red and green, then green and blue.
    Rggb,
    /// Blue and green, then green and red.
    Bggr,
    /// Green and blue, then red and green.
    Gbrg,
    /// Green and red, then blue and green.
    Grbg,
}

/// The encoding of an image's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// `mono8`, `8UC1`: brightness.
    Mono8,
    /// `rgb8`.
    Rgb8,
    /// `bgr8`, `8UC3`: OpenCV's order.
    Bgr8,
    /// `rgba8`.
    Rgba8,
    /// `bgra8`, `8UC4`.
    Bgra8,
    /// `mono16`: brightness over the whole range of 16 bits.
    Mono16,
    /// `16UC1`: any number, mostly depth in millimetres; not a picture.
    U16,
    /// `32FC1`: depth in metres.
    Float32,
    /// `bayer_rggb8` and other patterns: one colour per pixel, to be interpolated before use.
    Bayer8(BayerPattern),
    /// `bayer_rggb16` and other patterns.
    Bayer16(BayerPattern),
    /// `yuv422`, `uyvy`: brightness and, of every two pixels, a colour, in the order U, Y, V, Y.
    Uyvy,
    /// `yuv422_yuy2`, `yuyv`: the same in the order Y, U, Y, V.
    Yuyv,
}

impl Encoding {
    /// The encoding by its name in a message.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        if let Some(bayer) = name.strip_prefix("bayer_") {
            let pattern = match bayer.get(..4)? {
                "rggb" => BayerPattern::Rggb,
                "bggr" => BayerPattern::Bggr,
                "gbrg" => BayerPattern::Gbrg,
                "grbg" => BayerPattern::Grbg,
                _ => return None,
            };
            return match &bayer[4..] {
                "8" => Some(Self::Bayer8(pattern)),
                "16" => Some(Self::Bayer16(pattern)),
                _ => None,
            };
        }
        Some(match name {
            "mono8" | "8UC1" => Self::Mono8,
            "rgb8" => Self::Rgb8,
            "bgr8" | "8UC3" => Self::Bgr8,
            "rgba8" => Self::Rgba8,
            "bgra8" | "8UC4" => Self::Bgra8,
            "mono16" => Self::Mono16,
            "16UC1" => Self::U16,
            "32FC1" => Self::Float32,
            "yuv422" | "uyvy" => Self::Uyvy,
            "yuv422_yuy2" | "yuyv" => Self::Yuyv,
            _ => return None,
        })
    }

    /// Bytes per pixel.
    #[must_use]
    pub fn pixel_bytes(self) -> usize {
        match self {
            Self::Mono8 | Self::Bayer8(_) => 1,
            Self::Mono16 | Self::U16 | Self::Bayer16(_) | Self::Uyvy | Self::Yuyv => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 | Self::Float32 => 4,
        }
    }
}

impl Image<'_> {
    /// The encoding of its pixels.
    ///
    /// # Errors
    /// [`MessageError::Encoding`] for an unknown one.
    pub fn pixel_encoding(&self) -> Result<Encoding, MessageError> {
        Encoding::from_name(&self.encoding)
            .ok_or_else(|| self.wrong_encoding(format!("{PICTURES}, {NUMBERS}")))
    }

    /// Its rows from top to bottom, each `width` pixels without the padding after them.
    ///
    /// # Errors
    /// [`MessageError::Encoding`], and [`MessageError::Layout`] if a row does not fit into its step, or the rows into
    /// the data.
    pub fn rows(&self) -> Result<impl Iterator<Item = &[u8]>, MessageError> {
        let (width, height) = (self.width as usize, self.height as usize);
        let (row, step) = (
            width.saturating_mul(self.pixel_encoding()?.pixel_bytes()),
            self.step as usize,
        );
        if height > 0 && row > step {
            return Err(self.wrong_layout(LayoutProblem::Row { row, step }));
        }
        // The last row needs no padding after it.
        let needed = height
            .saturating_sub(1)
            .saturating_mul(step)
            .saturating_add(row);
        if height > 0 && needed > self.data.len() {
            let left = self.data.len();
            return Err(self.wrong_layout(LayoutProblem::Pixels { needed, left }));
        }
        let data = &self.data[..];
        // An image without columns has no pixels, however many rows it claims.
        let rows = if row == 0 { 0 } else { height };
        Ok((0..rows).map(move |y| data.get(y * step..y * step + row).unwrap_or_default()))
    }

    /// The pixels of `mono16` and `16UC1` (a depth image's millimetres), row by row, in this machine's byte order.
    ///
    /// # Errors
    /// As [`Image::rows`]; [`MessageError::Encoding`] for other encodings.
    pub fn u16s(&self) -> Result<impl Iterator<Item = u16>, MessageError> {
        if !matches!(self.pixel_encoding()?, Encoding::Mono16 | Encoding::U16) {
            return Err(self.wrong_encoding("mono16, 16UC1"));
        }
        let big = self.is_bigendian != 0;
        let number = move |bytes: &[u8; 2]| {
            if big {
                u16::from_be_bytes(*bytes)
            } else {
                u16::from_le_bytes(*bytes)
            }
        };
        Ok(self.rows()?.flat_map(|row| row.as_chunks().0).map(number))
    }

    /// The pixels of `32FC1` (a depth image's metres), row by row, in this machine's byte order.
    ///
    /// # Errors
    /// As [`Image::rows`]; [`MessageError::Encoding`] for other encodings.
    pub fn f32s(&self) -> Result<impl Iterator<Item = f32>, MessageError> {
        if self.pixel_encoding()? != Encoding::Float32 {
            return Err(self.wrong_encoding("32FC1"));
        }
        let big = self.is_bigendian != 0;
        let number = move |bytes: &[u8; 4]| {
            if big {
                f32::from_be_bytes(*bytes)
            } else {
                f32::from_le_bytes(*bytes)
            }
        };
        Ok(self.rows()?.flat_map(|row| row.as_chunks().0).map(number))
    }

    /// The picture as RGB, `height` × `width` × 3, without padding; alpha is dropped, brightness becomes grey, 16-bit values are
    /// scaled by 255 / 65535. Bayer patterns are interpolated bilinearly and YUV is limited-range BT.601, both as in cv_bridge.
    ///
    /// # Errors
    /// As [`Image::rows`]; [`MessageError::Encoding`] for wider pixels, which are not pictures or not supported yet;
    /// [`MessageError::Layout`] for a Bayer pattern below 2 × 2 and for YUV of an odd width.
    pub fn to_rgb8(&self) -> Result<Vec<u8>, MessageError> {
        let Some(encoding) = Encoding::from_name(&self.encoding) else {
            return Err(self.wrong_encoding(PICTURES));
        };
        match encoding {
            Encoding::Rgb8 => self.each_pixel(|rgb: &[u8; 3]| *rgb),
            Encoding::Bgr8 => self.each_pixel(|&[b, g, r]| [r, g, b]),
            Encoding::Rgba8 => self.each_pixel(|&[r, g, b, _]| [r, g, b]),
            Encoding::Bgra8 => self.each_pixel(|&[b, g, r, _]| [r, g, b]),
            Encoding::Mono8 => self.each_pixel(|&[grey]| [grey; 3]),
            // 65535 is 257 · 255; half of 257 rounds to the nearest.
            Encoding::Mono16 => {
                let grey = |wide: u16| ((u32::from(wide) + 128) / 257) as u8;
                Ok(self.u16s()?.flat_map(|wide| [grey(wide); 3]).collect())
            }
            Encoding::Bayer8(pattern) => {
                let rows: Vec<&[u8]> = self.rows()?.collect();
                if rows.is_empty() {
                    return Ok(Vec::new());
                }
                let rgb = bayer::to_rgb8(&rows, pattern);
                rgb.ok_or_else(|| self.wrong_layout(LayoutProblem::Bayer))
            }
            Encoding::Uyvy | Encoding::Yuyv if self.width % 2 == 1 => {
                Err(self.wrong_layout(LayoutProblem::OddWidth))
            }
            Encoding::Uyvy => self.each_pixel(|&[u, y0, v, y1]| yuv::pair([y0, y1], u, v)),
            Encoding::Yuyv => self.each_pixel(|&[y0, u, y1, v]| yuv::pair([y0, y1], u, v)),
            Encoding::U16 | Encoding::Float32 | Encoding::Bayer16(_) => {
                Err(self.wrong_encoding(PICTURES))
            }
        }
    }

    /// Passes every `N` bytes of every row to `change`, one after the other.
    fn each_pixel<const N: usize, const M: usize>(
        &self,
        change: impl Fn(&[u8; N]) -> [u8; M],
    ) -> Result<Vec<u8>, MessageError> {
        let mut rgb = Vec::with_capacity(self.data.len() / N * M);
        for row in self.rows()? {
            rgb.extend(row.as_chunks().0.iter().flat_map(&change));
        }
        Ok(rgb)
    }

    fn wrong_encoding(&self, expected: impl Into<Cow<'static, str>>) -> MessageError {
        MessageError::Encoding {
            encoding: self.encoding.clone(),
            expected: expected.into(),
        }
    }

    fn wrong_layout(&self, problem: LayoutProblem) -> MessageError {
        let of = MessagePart::Image {
            width: self.width,
            height: self.height,
            encoding: self.encoding.clone(),
        };
        MessageError::Layout { of, problem }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::Header;
    use deepfusion_hint::Hint;

    fn image<'a>(encoding: &str, width: u32, height: u32, step: u32, data: &'a [u8]) -> Image<'a> {
        Image {
            header: Header::default(),
            height,
            width,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step,
            data: Cow::Borrowed(data),
        }
    }

    #[test]
    fn colours_come_in_rgb_order_without_padding() {
        let padded = [1, 2, 3, 4, 5, 6, 0xee, 7, 8, 9, 10, 11, 12];
        let bgr = image("bgr8", 2, 2, 7, &padded).to_rgb8().unwrap();
        assert_eq!(bgr, [3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10]);
        assert_eq!(
            image("rgba8", 1, 1, 4, &[1, 2, 3, 4]).to_rgb8().unwrap(),
            [1, 2, 3]
        );
        assert_eq!(
            image("bgra8", 1, 1, 4, &[1, 2, 3, 4]).to_rgb8().unwrap(),
            [3, 2, 1]
        );
        assert_eq!(
            image("mono8", 2, 1, 2, &[1, 9]).to_rgb8().unwrap(),
            [1, 1, 1, 9, 9, 9]
        );
    }

    #[test]
    fn sixteen_bits_honour_step_and_byte_order() {
        let data = [1, 2, 3, 4, 0xee, 0xee, 5, 6, 7, 8, 0xee, 0xee];
        let mut depth = image("16UC1", 2, 2, 6, &data);
        let little: Vec<u16> = depth.u16s().unwrap().collect();
        assert_eq!(little, [0x0201, 0x0403, 0x0605, 0x0807]);
        depth.is_bigendian = 1;
        let big: Vec<u16> = depth.u16s().unwrap().collect();
        assert_eq!(big, [0x0102, 0x0304, 0x0506, 0x0708]);
        let metres = image("32FC1", 1, 1, 4, &[0, 0, 0x20, 0x41]);
        assert_eq!(metres.f32s().unwrap().collect::<Vec<_>>(), [10.0]);
    }

    #[test]
    fn encodings_that_give_no_colour_are_named() {
        assert_eq!(
            Encoding::from_name("bayer_grbg8"),
            Some(Encoding::Bayer8(BayerPattern::Grbg))
        );
        assert_eq!(Encoding::from_name("bayer_ééé"), None);
        for encoding in ["bayer_rggb16", "16UC1", "32FC1", "nv12", ""] {
            let error = image(encoding, 1, 1, 4, &[0; 4]).to_rgb8().unwrap_err();
            assert!(error.to_string().contains(encoding), "{error}");
            assert!(error.hint().is_some_and(|hint| hint.contains(PICTURES)));
        }
    }

    /// The encodings that the hint lists are read; others are not.
    #[test]
    fn the_list_of_readable_encodings_is_correct() {
        let names = |list: &'static str| list.split(',').map(str::trim);
        for name in names(PICTURES) {
            let rgb = image(name, 2, 2, 8, &[0; 16]).to_rgb8();
            assert_eq!(rgb.map(|rgb| rgb.len()), Ok(12), "{name}");
        }
        for name in names(NUMBERS) {
            let wide = image(name, 2, 2, 8, &[0; 16]);
            assert!(wide.pixel_encoding().is_ok(), "{name}");
            assert!(wide.to_rgb8().is_err(), "{name}");
        }
    }

    #[test]
    fn sizes_that_a_pattern_cannot_have_are_errors() {
        let problem = |encoding, width, height| {
            let error = image(encoding, width, height, 8, &[0; 32]).to_rgb8();
            error.unwrap_err().to_string()
        };
        for (width, height) in [(1, 4), (4, 1), (1, 1)] {
            let text = problem("bayer_gbrg8", width, height);
            assert!(
                text.contains("two rows") && text.contains("bayer_gbrg8"),
                "{text}"
            );
        }
        assert!(problem("bayer_gbrg8", 9, 2).contains("step of 8"));
        assert!(problem("bayer_gbrg8", 8, 5).contains("40 bytes needed, there are 32"));
        for encoding in ["yuv422", "yuv422_yuy2"] {
            assert!(problem(encoding, 3, 2).contains("3x2"), "{encoding}");
            assert!(problem(encoding, 3, 2).contains("even"), "{encoding}");
            assert!(problem(encoding, 6, 2).contains("step of 8"), "{encoding}");
        }
        assert!(problem("mono16", 5, 2).contains("step of 8"));
        for encoding in ["bayer_rggb8", "yuv422", "mono16"] {
            assert_eq!(image(encoding, 0, u32::MAX, 0, &[]).to_rgb8(), Ok(vec![]));
            assert!(
                image(encoding, u32::MAX - 1, u32::MAX, u32::MAX, &[0; 8])
                    .to_rgb8()
                    .is_err()
            );
        }
    }

    #[test]
    fn wrong_sizes_are_errors() {
        let rows = |width, height, step| {
            image("rgb8", width, height, step, &[0; 12])
                .rows()
                .map(Iterator::count)
        };
        assert_eq!(rows(2, 2, 6), Ok(2));
        assert!(
            rows(2, 3, 6)
                .unwrap_err()
                .to_string()
                .contains("18 bytes needed, there are 12")
        );
        assert!(rows(3, 2, 6).unwrap_err().to_string().contains("step of 6"));
        assert!(rows(u32::MAX, u32::MAX, u32::MAX).is_err());
        assert_eq!(rows(0, u32::MAX, 0), Ok(0));
    }

    proptest::proptest! {
        /// Whatever a driver claims, the result has all pixels or is an error.
        #[test]
        fn no_claimed_size_panics(number in 0usize..40, width in 0..12u32, height in 0..12u32, step in 0..40u32, data in proptest::collection::vec(0..=255u8, 0..300), big in 0..2u8) {
            let names: Vec<&str> = PICTURES.split(',').chain(NUMBERS.split(',')).collect();
            let name = names[number % names.len()].trim();
            let picture = Image { is_bigendian: big, ..image(name, width, height, step, &data) };
            if let Ok(rgb) = picture.to_rgb8() {
                proptest::prop_assert_eq!(rgb.len(), (width * height * 3) as usize);
            }
        }
    }
}
