//! An image's pixels, by its encoding and step.

use super::{Image, MessageError};

/// The order of a sensor's colour filters: the first row's two, then the second's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum BayerPattern {
    Rggb,
    Bggr,
    Gbrg,
    Grbg,
}

/// What an image's pixels are.
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
    /// `mono16`, `16UC1`: brightness, or depth in millimetres.
    Mono16,
    /// `32FC1`: depth in metres.
    Float32,
    /// `bayer_rggb8` and its kin: one colour a pixel, to be interpolated before use.
    Bayer8(BayerPattern),
    /// `bayer_rggb16` and its kin.
    Bayer16(BayerPattern),
}

impl Encoding {
    /// From the message's text.
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
            "mono16" | "16UC1" => Self::Mono16,
            "32FC1" => Self::Float32,
            _ => return None,
        })
    }

    /// Bytes a pixel.
    #[must_use]
    pub fn pixel_bytes(self) -> usize {
        match self {
            Self::Mono8 | Self::Bayer8(_) => 1,
            Self::Mono16 | Self::Bayer16(_) => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 | Self::Float32 => 4,
        }
    }
}

impl Image<'_> {
    /// What its pixels are.
    ///
    /// # Errors
    /// [`MessageError::Encoding`] for one that is not known here.
    pub fn pixel_encoding(&self) -> Result<Encoding, MessageError> {
        Encoding::from_name(&self.encoding).ok_or_else(|| {
            self.wrong_encoding(
                "mono8, rgb8, bgr8, rgba8, bgra8, mono16, 16UC1, 32FC1 or a Bayer pattern",
            )
        })
    }

    /// Its rows from top to bottom, each `width` pixels without the padding behind them.
    ///
    /// # Errors
    /// [`MessageError::Encoding`], and [`MessageError::Layout`] where a row does not fit into its step, or the rows into
    /// the data.
    pub fn rows(&self) -> Result<impl Iterator<Item = &[u8]>, MessageError> {
        let (width, height) = (self.width as usize, self.height as usize);
        let (row, step) = (
            width.saturating_mul(self.pixel_encoding()?.pixel_bytes()),
            self.step as usize,
        );
        let wrong = |problem| MessageError::Layout {
            what: format!("image of {width}x{height} {}", self.encoding),
            problem,
        };
        if height > 0 && row > step {
            return Err(wrong(format!(
                "a row of {row} bytes does not fit into a step of {step}"
            )));
        }
        // The last row needs no padding behind it.
        let needed = height
            .saturating_sub(1)
            .saturating_mul(step)
            .saturating_add(row);
        if height > 0 && needed > self.data.len() {
            return Err(wrong(format!(
                "{needed} bytes needed, there are {}",
                self.data.len()
            )));
        }
        let data = &self.data[..];
        // Nothing is shown of an image without columns, however many rows it claims.
        let rows = if row == 0 { 0 } else { height };
        Ok((0..rows).map(move |y| data.get(y * step..y * step + row).unwrap_or_default()))
    }

    /// The pixels of `mono16` and `16UC1` (a depth image's millimetres), row by row, in this machine's byte order.
    ///
    /// # Errors
    /// As [`Image::rows`]; [`MessageError::Encoding`] for other encodings.
    pub fn u16s(&self) -> Result<impl Iterator<Item = u16>, MessageError> {
        if self.pixel_encoding()? != Encoding::Mono16 {
            return Err(self.wrong_encoding("mono16 or 16UC1"));
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

    /// The picture as RGB, `height` × `width` × 3, without padding; alpha is dropped, brightness becomes grey.
    ///
    /// # Errors
    /// As [`Image::rows`]; [`MessageError::Encoding`] for Bayer patterns and wider pixels, which say no colour yet.
    pub fn to_rgb8(&self) -> Result<Vec<u8>, MessageError> {
        let encoding = self.pixel_encoding()?;
        let rows = self.rows()?;
        let mut rgb = Vec::with_capacity(self.data.len() / encoding.pixel_bytes() * 3);
        for row in rows {
            match encoding {
                Encoding::Rgb8 => rgb.extend_from_slice(row),
                Encoding::Mono8 => rgb.extend(row.iter().flat_map(|&grey| [grey; 3])),
                Encoding::Bgr8 => {
                    rgb.extend(row.as_chunks().0.iter().flat_map(|&[b, g, r]| [r, g, b]))
                }
                Encoding::Rgba8 => {
                    rgb.extend(row.as_chunks().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]))
                }
                Encoding::Bgra8 => {
                    rgb.extend(row.as_chunks().0.iter().flat_map(|&[b, g, r, _]| [r, g, b]))
                }
                Encoding::Mono16
                | Encoding::Float32
                | Encoding::Bayer8(_)
                | Encoding::Bayer16(_) => {
                    return Err(self.wrong_encoding("mono8, rgb8, bgr8, rgba8 or bgra8"));
                }
            }
        }
        Ok(rgb)
    }

    fn wrong_encoding(&self, expected: &'static str) -> MessageError {
        MessageError::Encoding {
            encoding: self.encoding.clone(),
            expected,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::Header;
    use std::borrow::Cow;

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
        for encoding in ["bayer_rggb8", "16UC1", "yuv422"] {
            let error = image(encoding, 1, 1, 4, &[0; 4]).to_rgb8().unwrap_err();
            assert!(error.to_string().contains(encoding), "{error}");
            assert!(error.hint().is_some());
        }
    }

    #[test]
    fn sizes_that_lie_are_errors() {
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
}
