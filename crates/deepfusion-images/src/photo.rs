//! A single picture as a camera or a phone wrote it.

use super::exif_camera::{block, camera_of, number};
use super::files::decode_bytes;
use crate::{Error, Result};
use deepfusion_geometry::Intrinsics;
use exif::Tag;
use image::RgbImage;
use image::metadata::Orientation;
use std::io::Cursor;
use std::path::Path;

/// A picture, with the camera and the orientation from its EXIF block.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The picture, upright: rotated by EXIF's orientation.
    pub image: RgbImage,
    /// The camera from EXIF's focal length in 35 mm film, or from the phone's model and lens if their field of view is known, with
    /// square pixels and the principal point in the centre; `None` if EXIF gives neither. It is the lens's nominal focal length, so it
    /// is wrong for a picture that was cropped later.
    pub intrinsics: Option<Intrinsics>,
    /// EXIF's orientation, by which the picture was rotated: 1 is as it is stored, 6 and 8 are quarter turns, 3 is half a turn.
    pub orientation: u8,
}

/// Reads a PNG or JPEG as [`crate::load_rgb`] does, turns it upright, and takes its camera from EXIF. A damaged block
/// is ignored.
///
/// # Errors
/// As [`crate::load_rgb`].
pub fn load_photo(path: &Path) -> Result<Photo> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    let mut image = decode_bytes(&bytes, path)?;
    let exif = block(Cursor::new(&bytes));
    let exif = exif.as_ref();
    let turn = exif.and_then(|exif| number(exif, Tag::Orientation));
    let turn = turn.and_then(|n| Orientation::from_exif(u8::try_from(n).ok()?));
    let turn = turn.unwrap_or(Orientation::NoTransforms);
    image.apply_orientation(turn);
    let image = image.into_rgb8();
    let camera = exif.and_then(|exif| camera_of(exif, image.dimensions()));
    let intrinsics = camera.map(|camera| camera.intrinsics);
    Ok(Photo {
        image,
        intrinsics,
        orientation: turn.to_exif(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use exif::experimental::Writer;
    use exif::{Field, In, Value};
    use image::Rgb;

    /// A JPEG of 64×48, left half red and right half blue, with these fields.
    fn jpeg(fields: &[(Tag, u16)]) -> Vec<u8> {
        let half = |x: u32, _| {
            if x < 32 {
                Rgb([220, 20, 20])
            } else {
                Rgb([20, 20, 220])
            }
        };
        let mut plain = Vec::new();
        RgbImage::from_fn(64, 48, half)
            .write_to(&mut Cursor::new(&mut plain), image::ImageFormat::Jpeg)
            .unwrap();
        if fields.is_empty() {
            return plain;
        }
        let fields: Vec<Field> = fields
            .iter()
            .map(|(tag, value)| Field {
                tag: *tag,
                ifd_num: In::PRIMARY,
                value: Value::Short(vec![*value]),
            })
            .collect();
        let mut writer = Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        let mut block = Cursor::new(Vec::new());
        writer.write(&mut block, true).unwrap();
        let block = block.into_inner();
        // After the start of the image: APP1, its length, its name, the block.
        let length = u16::try_from(block.len() + 8).unwrap().to_be_bytes();
        let app1 = [&[0xFF, 0xE1], &length[..], b"Exif\0\0", &block[..]].concat();
        [&plain[..2], &app1[..], &plain[2..]].concat()
    }

    fn load(bytes: &[u8]) -> Photo {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("street.jpg");
        std::fs::write(&path, bytes).unwrap();
        load_photo(&path).unwrap()
    }

    fn is_red(image: &RgbImage, x: u32, y: u32) -> bool {
        let Rgb([r, _, b]) = *image.get_pixel(x, y);
        r > b
    }

    #[test]
    fn a_phones_picture_is_upright_and_has_a_camera() {
        // 6: the right-hand side of the stored picture is the bottom: rotated by 90 degrees clockwise.
        let photo = load(&jpeg(&[
            (Tag::Orientation, 6),
            (Tag::FocalLengthIn35mmFilm, 26),
        ]));
        assert_eq!(photo.image.dimensions(), (48, 64));
        assert_eq!(photo.orientation, 6);
        assert!(is_red(&photo.image, 24, 5) && !is_red(&photo.image, 24, 60));
        let camera = photo.intrinsics.unwrap();
        // 26 mm of a diagonal of 43.27 mm; the picture's diagonal is 80 pixels.
        assert!((camera.fx - 26.0 / 43.2666 * 80.0).abs() < 1e-3);
        assert_eq!(camera.fx, camera.fy);
        assert_eq!((camera.width, camera.height), (48, 64));
        assert_eq!((camera.cx, camera.cy), (23.5, 31.5));
        assert_eq!(camera.implausible(), None);
    }

    #[test]
    fn a_separate_exif_block_gives_the_same_camera() {
        let bytes = jpeg(&[(Tag::FocalLengthIn35mmFilm, 26)]);
        // After the marker and the length of APP1; what follows the block is skipped.
        let camera = crate::exif_block_camera(&bytes[6..], (64, 48)).unwrap();
        assert_eq!(Some(camera.intrinsics), load(&bytes).intrinsics);
        assert_eq!(crate::exif_block_camera(b"no block", (64, 48)), None);
    }

    #[test]
    fn missing_and_impossible_values_give_no_camera() {
        for fields in [
            &[][..],
            &[(Tag::FocalLengthIn35mmFilm, 0)],
            &[(Tag::FocalLengthIn35mmFilm, 60_000), (Tag::Orientation, 99)],
        ] {
            let photo = load(&jpeg(fields));
            assert_eq!(photo.intrinsics, None, "{fields:?}");
            assert_eq!(photo.orientation, 1);
            assert_eq!(photo.image.dimensions(), (64, 48));
            assert!(is_red(&photo.image, 5, 24));
        }
        // A damaged block is no reason to refuse a picture.
        let mut damaged = jpeg(&[(Tag::FocalLengthIn35mmFilm, 26)]);
        for byte in &mut damaged[12..30] {
            *byte = 0xAB;
        }
        assert_eq!(load(&damaged).intrinsics, None);
    }
}
