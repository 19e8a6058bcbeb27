//! A picture's camera, from its EXIF block.

use super::known_cameras::{FILM_DIAGONAL_MM, KnownCamera, is_action_camera};
use deepfusion_geometry::Intrinsics;
use exif::{Exif, In, Tag, Value};
use std::io::{BufRead, Seek};
use std::ops::RangeInclusive;
use std::path::Path;

/// Equivalent focal lengths of real lenses, mm.
const FOCAL_LENGTHS_MM: RangeInclusive<u32> = 5..=2000;

/// A pinhole camera from a picture's EXIF block, and the data it was computed from.
#[derive(Debug, Clone, PartialEq)]
pub struct ExifCamera {
    /// Intrinsics in pixels of the picture as stored, or rotated by quarter turns: square pixels, the principal point in the centre.
    pub intrinsics: Intrinsics,
    /// The data it was computed from, as text for people.
    pub by: String,
    /// Whether an action camera took it, whose wide lenses are not pinholes.
    pub action_camera: bool,
    /// Whether the picture has to be rotated or mirrored to be upright.
    pub turned: bool,
}

/// The EXIF block of a PNG or JPEG.
pub(super) fn block(mut bytes: impl BufRead + Seek) -> Option<Exif> {
    readable(|reader| reader.read_from_container(&mut bytes))
}

/// Parses a block. Of a damaged one, the readable part is used: some libraries omit the end of a directory.
fn readable(read: impl FnOnce(&exif::Reader) -> Result<Exif, exif::Error>) -> Option<Exif> {
    let mut reader = exif::Reader::new();
    reader.continue_on_error(true);
    read(&reader)
        .or_else(|error| error.distill_partial_result(|_| ()))
        .ok()
}

/// The camera in the EXIF block of a picture's file; the picture is `size` pixels wide and high. `None` if the block has no camera, or
/// the file cannot be read.
#[must_use]
pub fn exif_camera(path: &Path, size: (u32, u32)) -> Option<ExifCamera> {
    let file = std::fs::File::open(path).ok()?;
    camera_of(&block(std::io::BufReader::new(file))?, size)
}

/// The camera in an EXIF block, as in [`exif_camera`]; the picture is `size` pixels wide and high. `block` is a TIFF structure, with or
/// without JPEG's `Exif\0\0` before it; `None` if it has no camera, or is damaged.
#[must_use]
pub fn exif_block_camera(block: &[u8], size: (u32, u32)) -> Option<ExifCamera> {
    let tiff = block.strip_prefix(b"Exif\0\0").unwrap_or(block);
    camera_of(&readable(|reader| reader.read_raw(tiff.to_vec()))?, size)
}

/// From the focal length in 35 mm film, else from the make, the model and the lens.
pub(super) fn camera_of(exif: &Exif, size: (u32, u32)) -> Option<ExifCamera> {
    let (intrinsics, by) = of_film(exif, size).or_else(|| of_model(exif, size))?;
    Some(ExifCamera {
        intrinsics,
        by,
        action_camera: text(exif, Tag::Make).is_some_and(|make| is_action_camera(&make)),
        turned: number(exif, Tag::Orientation).is_some_and(|turn| turn > 1),
    })
}

pub(super) fn number(exif: &Exif, tag: Tag) -> Option<u32> {
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0)
}

fn of_film(exif: &Exif, (width, height): (u32, u32)) -> Option<(Intrinsics, String)> {
    let mm = number(exif, Tag::FocalLengthIn35mmFilm).filter(|mm| FOCAL_LENGTHS_MM.contains(mm))?;
    let diagonal = f64::from(width).hypot(f64::from(height));
    let focal_px = f64::from(mm) / FILM_DIAGONAL_MM * diagonal;
    let camera = Intrinsics::centred(focal_px, (width, height));
    Some((camera, format!("{mm} mm in 35 mm film")))
}

fn of_model(exif: &Exif, size: (u32, u32)) -> Option<(Intrinsics, String)> {
    // In EXIF, 0 means "not used".
    let zoomed = ratio(exif, Tag::DigitalZoomRatio).is_some_and(|zoom| zoom > 0.0 && zoom != 1.0);
    let lens_mm = ratio(exif, Tag::FocalLength)?;
    let (make, model) = (text(exif, Tag::Make)?, text(exif, Tag::Model)?);
    let known = KnownCamera::find(&make, &model, lens_mm).filter(|_| !zoomed)?;
    let camera = Intrinsics::centred(known.focal_px(size), size);
    let by = format!(
        "the main camera of {make} {model}, {:.1} mm in 35 mm film",
        known.film_mm()
    );
    Some((camera, by))
}

fn ratio(exif: &Exif, tag: Tag) -> Option<f64> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(numbers) => numbers
            .first()
            .map(exif::Rational::to_f64)
            .filter(|n| n.is_finite()),
        _ => None,
    }
}

fn text(exif: &Exif, tag: Tag) -> Option<String> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(lines) => {
            let line = String::from_utf8_lossy(lines.first()?).into_owned();
            Some(line.trim_matches(['\0', ' ']).to_owned())
        }
        _ => None,
    }
}
