//! Folders, files and pictures that a drive is written to.

use crate::{Error, Result};
use deepfusion_fs::InTheWay;
use deepfusion_geometry::DepthMap;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::fs;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Refuses an output folder that is not empty. The folder need not exist.
pub(crate) fn require_empty(out: &Path) -> Result<()> {
    let found = deepfusion_fs::in_the_way(out);
    match found.map_err(io(out, "use this as the output folder"))? {
        None => Ok(()),
        Some(InTheWay::Content) => Err(Error::OutputNotEmpty {
            path: out.to_owned(),
        }),
        Some(InTheWay::Unfinished(unfinished)) => Err(unfinished.into()),
    }
}

/// The error of an action on a path.
pub(crate) fn io<'a>(
    path: &'a Path,
    action: &'static str,
) -> impl Fn(std::io::Error) -> Error + 'a {
    move |source| Error::Io {
        path: path.to_owned(),
        action,
        source,
    }
}

pub(crate) fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(io(path, "create this folder"))
}

/// Writes a file of the drive through a buffer.
pub(crate) fn write_with(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<fs::File>) -> Result<()>,
) -> Result<()> {
    let failed = io(path, "write this file");
    let file = fs::File::create(path).map_err(&failed)?;
    let mut writer = BufWriter::with_capacity(1 << 16, file);
    fill(&mut writer)?;
    writer.flush().map_err(&failed)
}

pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |w| {
        w.write_all(bytes).map_err(io(path, "write this file"))
    })
}

/// A PNG of these bytes; `path` is named in errors.
pub(crate) fn encode(
    out: impl Write,
    path: &Path,
    bytes: &[u8],
    (width, height): (u32, u32),
    colour: ExtendedColorType,
    filter: FilterType,
) -> Result<()> {
    PngEncoder::new_with_quality(out, CompressionType::Fast, filter)
        .write_image(bytes, width, height, colour)
        .map_err(|error| match error {
            image::ImageError::IoError(source) => io(path, "write this file")(source),
            source => Error::Encode {
                path: path.to_owned(),
                source,
            },
        })
}

/// A PNG of a picture; `path` is named in errors.
pub(crate) fn encode_rgb(out: impl Write, path: &Path, rgb: &image::RgbImage) -> Result<()> {
    let colour = ExtendedColorType::Rgb8;
    let size = rgb.dimensions();
    encode(out, path, rgb.as_raw(), size, colour, FilterType::Sub)
}

/// KITTI's 16-bit depth: metres × 256, 0 where there is none.
pub(crate) fn encode_depth(out: impl Write, path: &Path, depth: &DepthMap) -> Result<()> {
    let bytes: Vec<u8> = depth
        .data
        .iter()
        .flat_map(|d| {
            let value = (f64::from(*d) * 256.0).round();
            let value = if value < 65_536.0 { value as u16 } else { 0 };
            // The encoder expects native byte order.
            value.to_ne_bytes()
        })
        .collect();
    let size = (depth.width as u32, depth.height as u32);
    let colour = ExtendedColorType::L16;
    encode(out, path, &bytes, size, colour, FilterType::Sub)
}
