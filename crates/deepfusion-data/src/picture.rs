//! Images from files, resized and as numbers.

use crate::{Error, Result, jpeg, write_atomically};
use fast_image_resize::images::{Image, ImageRef};
use fast_image_resize::{FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer};
use image::{DynamicImage, ImageError, ImageReader, RgbImage};
use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

/// Reads a PNG or JPEG, told apart by content, as 8-bit RGB. Grey becomes RGB, 16 bits become 8, an
/// alpha channel is left out.
///
/// # Errors
/// [`Error::NoSuchPath`], [`Error::File`], or [`Error::Image`] where the content is no such image or
/// ends early.
pub fn load_rgb(path: &Path) -> Result<RgbImage> {
    Ok(decode(path)?.into_rgb8())
}

/// A PNG or JPEG in the pixel type it has.
pub(crate) fn decode(path: &Path) -> Result<DynamicImage> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    if jpeg::is_jpeg(&bytes) && !jpeg::has_end(&bytes) {
        return Err(truncated(path));
    }
    reader(Cursor::new(bytes.as_slice()), path)?
        .decode()
        .map_err(|e| broken(path, &e))
}

/// Width and height of a PNG or JPEG, from its header alone.
///
/// # Errors
/// As [`load_rgb`]; a file cut off after its header is not noticed here.
pub fn image_size(path: &Path) -> Result<(u32, u32)> {
    let file = std::fs::File::open(path).map_err(|e| Error::file(path, e))?;
    let mut input = std::io::BufReader::new(file);
    let begin = input.fill_buf().map_err(|e| Error::file(path, e))?;
    if !jpeg::is_jpeg(begin) {
        return reader(input, path)?
            .into_dimensions()
            .map_err(|e| broken(path, &e));
    }
    match jpeg::size(&mut input) {
        Ok(Some(size)) => Ok(size),
        Ok(None) => Err(Error::Image {
            path: path.to_owned(),
            problem: "the JPEG has no frame header".into(),
            truncated: false,
        }),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Err(truncated(path)),
        Err(e) => Err(Error::file(path, e)),
    }
}

fn reader<R: BufRead + Seek>(input: R, path: &Path) -> Result<ImageReader<R>> {
    let reader = ImageReader::new(input)
        .with_guessed_format()
        .map_err(|e| Error::file(path, e))?;
    if reader.format().is_none() {
        return Err(Error::Image {
            path: path.to_owned(),
            problem: "neither a PNG nor a JPEG".into(),
            truncated: false,
        });
    }
    Ok(reader)
}

fn broken(path: &Path, error: &ImageError) -> Error {
    // The PNG decoder reports a cut file as an unexpected end, at some depth of its causes.
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(e) = cause {
        let io = e.downcast_ref::<std::io::Error>();
        let text = e.to_string().to_lowercase();
        if io.is_some_and(|io| io.kind() == std::io::ErrorKind::UnexpectedEof)
            || text.contains("unexpected end")
            || text.contains("unexpected eof")
            || text.contains("exhausted")
        {
            return truncated(path);
        }
        cause = e.source();
    }
    Error::Image {
        path: path.to_owned(),
        problem: format!("cannot be decoded: {error}"),
        truncated: false,
    }
}

fn truncated(path: &Path) -> Error {
    Error::Image {
        path: path.to_owned(),
        problem: "the image is truncated: the file ends within it".into(),
        truncated: true,
    }
}

/// Resizes with a Lanczos filter of three lobes, antialiased when shrinking, half-pixel centres: what
/// PIL's `LANCZOS` does, to one grey level. `width` or `height` 0 gives an empty image.
#[must_use]
pub fn resize_rgb(image: &RgbImage, width: u32, height: u32) -> RgbImage {
    if image.dimensions() == (width, height) {
        return image.clone();
    }
    if width == 0 || height == 0 || image.width() == 0 || image.height() == 0 {
        return RgbImage::new(width, height);
    }
    // Columns first, then rows, as PIL does. Overshoot at edges is cut off after each pass, so that the
    // other order differs by tens of levels beside high contrasts.
    let narrowed = pass(image, width, image.height());
    pass(&narrowed, width, height)
}

/// Resizes to a size that differs along one axis.
fn pass(image: &RgbImage, width: u32, height: u32) -> RgbImage {
    if image.dimensions() == (width, height) {
        return image.clone();
    }
    let mut resized = RgbImage::new(width, height);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Lanczos3));
    let bytes = image.as_raw().as_slice();
    let source = ImageRef::new(image.width(), image.height(), bytes, PixelType::U8x3)
        .expect("an RgbImage holds width x height x 3 bytes");
    let mut target = Image::from_slice_u8(width, height, &mut resized, PixelType::U8x3)
        .expect("an RgbImage holds width x height x 3 bytes");
    Resizer::new()
        .resize(&source, &mut target, &options)
        .expect("both images are 8-bit RGB and not empty, the only reasons to refuse");
    resized
}

/// The image as 3×H×W floats in [0, 1], channel by channel.
#[must_use]
pub fn to_chw(image: &RgbImage) -> Vec<f32> {
    let bytes = image.as_raw();
    let mut chw = Vec::with_capacity(bytes.len());
    for channel in 0..3 {
        chw.extend(
            bytes
                .iter()
                .skip(channel)
                .step_by(3)
                .map(|b| f32::from(*b) / 255.0),
        );
    }
    chw
}

/// Writes the image as a PNG, atomically.
///
/// # Errors
/// [`Error::File`] where writing fails.
pub fn save_png(image: &RgbImage, path: &Path) -> Result<()> {
    write_atomically(path, |out| {
        image
            .write_to(out, image::ImageFormat::Png)
            .map_err(|e| write_failed(path, e))
    })
}

/// The system's error inside an encoder's, named by file.
pub(crate) fn write_failed(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(source) => Error::file(path, source),
        other => Error::file(path, std::io::Error::other(other)),
    }
}
