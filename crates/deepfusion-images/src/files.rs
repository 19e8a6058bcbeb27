//! Reads and writes image files, and tells which files are images.

use super::jpeg;
use crate::{Error, ImageProblem, Result};
use image::{DynamicImage, ImageError, ImageFormat, ImageReader, ImageResult, RgbImage};
use std::fs::File;
use std::io::{BufRead, BufWriter, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Endings of file names that are taken as images, in lower case.
pub const IMAGE_ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// The chunk that ends every PNG.
const PNG_END: [u8; 12] = *b"\0\0\0\0IEND\xAE\x42\x60\x82";

/// Whether a file is named like an image.
#[must_use]
pub fn is_image(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str());
    ending.is_some_and(|e| IMAGE_ENDINGS.contains(&e.to_ascii_lowercase().as_str()))
}

/// Reads a PNG or JPEG, recognised by content, as 8-bit RGB. Grey becomes RGB, 16 bits become 8, an
/// alpha channel is left out.
///
/// # Errors
/// [`Error::File`], or [`Error::Image`] if the content is not such an image or
/// ends early.
pub fn load_rgb(path: &Path) -> Result<RgbImage> {
    Ok(decode(path)?.into_rgb8())
}

/// [`load_rgb`] for a file's bytes that were read already; `path` is only for errors.
///
/// # Errors
/// As [`load_rgb`].
pub fn decode_rgb(bytes: &[u8], path: &Path) -> Result<RgbImage> {
    Ok(decode_bytes(bytes, path)?.into_rgb8())
}

/// Reads a PNG or JPEG in its own pixel type.
///
/// # Errors
/// As [`load_rgb`].
pub fn decode(path: &Path) -> Result<DynamicImage> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    decode_bytes(&bytes, path)
}

/// The same for a file's bytes; `path` is only for errors.
///
/// # Errors
/// As [`load_rgb`].
pub fn decode_bytes(bytes: &[u8], path: &Path) -> Result<DynamicImage> {
    if jpeg::is_jpeg(bytes) && !jpeg::has_end(bytes) {
        return Err(truncated(path));
    }
    reader(Cursor::new(bytes), path)?
        .decode()
        .map_err(|e| broken(path, e))
}

/// Width and height of a PNG or JPEG, from its header alone.
///
/// # Errors
/// As [`load_rgb`]; a file that was cut off after its header is not detected.
pub fn image_size(path: &Path) -> Result<(u32, u32)> {
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    let mut input = std::io::BufReader::new(file);
    let begin = input.fill_buf().map_err(|e| Error::file(path, e))?;
    if !jpeg::is_jpeg(begin) {
        return reader(input, path)?
            .into_dimensions()
            .map_err(|e| broken(path, e));
    }
    match jpeg::size(&mut input) {
        Ok(Some(size)) => Ok(size),
        Ok(None) => Err(Error::Image {
            path: path.to_owned(),
            problem: ImageProblem::NoFrameHeader,
        }),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Err(truncated(path)),
        Err(e) => Err(Error::file(path, e)),
    }
}

/// Checks that an image was not cut off. One that begins and ends as its format does is taken as complete. Any other is read, as some
/// programs leave out the end or add to it: cameras append data to a JPEG. A JPEG is then searched for its end; anything else is
/// decoded.
///
/// # Errors
/// As [`load_rgb`].
pub fn check_complete(path: &Path) -> Result<()> {
    if has_both_ends(path).unwrap_or(false) {
        return Ok(());
    }
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    if jpeg::is_jpeg(&bytes) && jpeg::has_end(&bytes) {
        return Ok(());
    }
    decode_bytes(&bytes, path).map(drop)
}

/// Whether a file begins and ends as a PNG or a JPEG.
fn has_both_ends(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let (mut begin, mut end) = ([0; 4], [0; 12]);
    file.read_exact(&mut begin)?;
    file.seek(SeekFrom::End(-12))?;
    file.read_exact(&mut end)?;
    let is_png = begin == *b"\x89PNG" && end == PNG_END;
    Ok(is_png || (jpeg::is_jpeg(&begin) && end.ends_with(&[0xFF, 0xD9])))
}

fn reader<R: BufRead + Seek>(input: R, path: &Path) -> Result<ImageReader<R>> {
    let reader = ImageReader::new(input)
        .with_guessed_format()
        .map_err(|e| Error::file(path, e))?;
    if reader.format().is_none() {
        return Err(Error::Image {
            path: path.to_owned(),
            problem: ImageProblem::OtherFormat,
        });
    }
    Ok(reader)
}

fn broken(path: &Path, error: ImageError) -> Error {
    match error {
        // The same error as the PNG decoder's for a truncated file; the end of a JPEG was checked before.
        ImageError::IoError(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => {
            truncated(path)
        }
        error => Error::Image {
            path: path.to_owned(),
            problem: ImageProblem::Undecodable(error),
        },
    }
}

fn truncated(path: &Path) -> Error {
    Error::Image {
        path: path.to_owned(),
        problem: ImageProblem::Truncated,
    }
}

/// Writes the image as a PNG, complete or not at all. The file is not synced: a caller that marks it as done has to sync it first.
///
/// # Errors
/// [`Error::File`] if writing fails.
pub fn save_png(image: &RgbImage, path: &Path) -> Result<()> {
    write_png(path, |out| image.write_to(out, ImageFormat::Png))
}

/// Writes a PNG, complete or not at all; `encode` writes its content.
///
/// # Errors
/// [`Error::File`] if writing fails.
pub(crate) fn write_png(
    path: &Path,
    encode: impl FnOnce(&mut BufWriter<File>) -> ImageResult<()>,
) -> Result<()> {
    deepfusion_fs::write_unsynced(
        path,
        |e| Error::file(path, e),
        |out| encode(out).map_err(|e| write_failed(path, e)),
    )
}

/// The system's error inside an encoder's, with the file's path.
fn write_failed(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(source) => Error::file(path, source),
        other => Error::file(path, std::io::Error::other(other)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_of_either_case_are_known() {
        for (name, image) in [
            ("a/0.PNG", true),
            ("0.jpeg", true),
            ("0.png.json", false),
            ("png", false),
        ] {
            assert_eq!(is_image(Path::new(name)), image, "{name}");
        }
    }

    #[test]
    fn a_truncated_file_is_noticed_by_its_missing_end() {
        let folder = tempfile::tempdir().unwrap();
        let noisy = RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb([
                (x * y % 251) as u8,
                (x * 7 % 256) as u8,
                (y * 13 % 256) as u8,
            ])
        });
        for name in ["a.png", "a.jpg"] {
            let path = folder.path().join(name);
            noisy.save(&path).unwrap();
            assert!(has_both_ends(&path).unwrap(), "{name}");
            check_complete(&path).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            let error = check_complete(&path).unwrap_err().to_string();
            assert!(
                error.contains(name) && error.contains("truncated"),
                "{error}"
            );
            // Data after the end is not damage.
            std::fs::write(&path, [&bytes[..], b"more"].concat()).unwrap();
            assert!(!has_both_ends(&path).unwrap(), "{name}");
            check_complete(&path).unwrap();
        }
        assert!(check_complete(&folder.path().join("none.png")).is_err());
    }
}
