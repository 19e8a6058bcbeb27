//! A frame's depth as sent to the page: the numbers of its file, unconverted.

use std::io::Read;
use std::path::Path;

use deepfusion_geometry::NpyHeader;
use deepfusion_images::{image_size, read_depth_png};

use crate::{ArrayProblem, ContentProblem, Error, Result};

/// More pixels than any camera's image has. A larger file is refused before memory is allocated for it.
const MOST_PIXELS: u64 = 64 << 20;

/// The number format of a [`DepthFile`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthCode {
    /// `u16` in steps of 1/256 m, 0 = none: a depth PNG.
    Steps256 = 0,
    /// `f32` metres, 0, negative and NaN = none: an NPY array.
    Metres = 1,
}

/// Depth along the camera's axis, row by row, in the numbers of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DepthFile {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The number format.
    pub code: DepthCode,
    /// The numbers, little endian.
    pub values: Vec<u8>,
}

impl DepthFile {
    /// First bytes of [`DepthFile::into_bytes`].
    pub const MAGIC: &[u8; 4] = b"DFD1";

    /// Reads `NAME_depth.png` or `NAME_depth.npy`.
    ///
    /// # Errors
    /// [`Error::Picture`] for a PNG that is truncated or not 16-bit grey, [`Error::Content`] for an array that is truncated, of
    /// another type than `f32` or `f64` or not two-dimensional, [`Error::File`] if reading fails.
    pub fn read(path: &Path) -> Result<Self> {
        if path.extension().is_some_and(|e| e == "npy") {
            return read_npy(path);
        }
        let (width, height) = image_size(path)?;
        if u64::from(width) * u64::from(height) > MOST_PIXELS {
            return Err(too_large(path, u64::from(width), u64::from(height)));
        }
        let map = read_depth_png(path)?;
        // v/256 is exact in f32 for every 16-bit v, so v is recovered exactly.
        let steps = map.data.iter().map(|m| (m * 256.0) as u16);
        Ok(Self {
            width,
            height,
            code: DepthCode::Steps256,
            values: steps.flat_map(u16::to_le_bytes).collect(),
        })
    }

    /// The bytes sent to the page: magic, width, height and code as 32-bit little endian numbers, then the values.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(16 + self.values.len());
        bytes.extend(Self::MAGIC);
        for number in [self.width, self.height, self.code as u32] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(self.values);
        bytes
    }
}

fn too_large(path: &Path, width: u64, height: u64) -> Error {
    Error::content(path, ContentProblem::TooLarge { width, height })
}

/// An array in NumPy's format 1 to 3 (numpy.lib.format), of the types that depth has.
fn read_npy(path: &Path) -> Result<DepthFile> {
    let failed = |e| Error::file(path, e);
    let mut file = std::fs::File::open(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    // NumPy writes no longer header for a plain array.
    let mut begin = Vec::new();
    file.by_ref()
        .take(4096)
        .read_to_end(&mut begin)
        .map_err(failed)?;
    let wrong = |problem: ArrayProblem| Error::content(path, problem);
    let header = NpyHeader::parse(&begin).map_err(|problem| wrong(problem.into()))?;
    let [height, width, item_bytes] = layout(&header).map_err(wrong)?;
    if width.checked_mul(height).is_none_or(|n| n > MOST_PIXELS) || width == 0 || height == 0 {
        return Err(too_large(path, width, height));
    }
    let expected = header.begin as u64 + width * height * item_bytes;
    if length < expected {
        let problem = ArrayProblem::Cut {
            bytes: length,
            expected,
            size: (width, height),
        };
        return Err(wrong(problem));
    }
    let read = begin.len() as u64;
    let mut values = begin.split_off(header.begin.min(begin.len()));
    // The numbers of a small array, and any bytes after them, have been read already.
    file.take(expected.saturating_sub(read))
        .read_to_end(&mut values)
        .map_err(failed)?;
    values.truncate((width * height * item_bytes) as usize);
    if item_bytes == 8 {
        values = values
            .chunks_exact(8)
            .flat_map(|b| {
                (f64::from_le_bytes(b.try_into().unwrap_or_default()) as f32).to_le_bytes()
            })
            .collect();
    }
    Ok(DepthFile {
        width: width as u32,
        height: height as u32,
        code: DepthCode::Metres,
        values,
    })
}

/// Height, width and bytes per number of a depth array.
fn layout(header: &NpyHeader) -> Result<[u64; 3], ArrayProblem> {
    let item_bytes = match header.descr.as_deref() {
        Some("<f4") => 4,
        Some("<f8") => 8,
        other => return Err(ArrayProblem::Type(other.map(str::to_owned))),
    };
    if header.fortran_order != Some(false) {
        return Err(ArrayProblem::ColumnByColumn);
    }
    match header.shape.as_slice() {
        &[height, width] => Ok([height, width, item_bytes]),
        other => Err(ArrayProblem::Dimensions(other.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::DepthMap;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Every value of a depth PNG is sent exactly.
        #[test]
        fn png_steps_arrive_exactly(steps in proptest::collection::vec(0u16.., 15)) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a_depth.png");
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(5, 3, steps.clone()).unwrap().save(&path).unwrap();
            let read = DepthFile::read(&path).unwrap();
            prop_assert_eq!((read.width, read.height, read.code), (5, 3, DepthCode::Steps256));
            let sent: Vec<u16> = read.values.chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
            prop_assert_eq!(sent, steps);
        }

        /// Every bit of an f32 array is sent; f64 is rounded once.
        #[test]
        fn npy_metres_arrive_exactly(metres in proptest::collection::vec(any::<f32>(), 6)) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a_depth.npy");
            let array = ndarray::Array2::from_shape_vec((2, 3), metres.clone()).unwrap();
            ndarray_npy::write_npy(&path, &array).unwrap();
            let read = DepthFile::read(&path).unwrap();
            prop_assert_eq!((read.width, read.height, read.code), (3, 2, DepthCode::Metres));
            let expected: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
            prop_assert_eq!(&read.values, &expected);
            ndarray_npy::write_npy(&path, &array.mapv(f64::from)).unwrap();
            let doubles = DepthFile::read(&path).unwrap();
            for (a, b) in doubles.values.chunks(4).zip(&metres) {
                let a = f32::from_le_bytes(a.try_into().unwrap());
                prop_assert!(a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan());
            }
        }

        /// Reading any bytes returns an error and does not panic.
        #[test]
        fn foreign_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), npy in any::<bool>()) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join(if npy { "a_depth.npy" } else { "a_depth.png" });
            let mut content = if npy { b"\x93NUMPY\x01\x00".to_vec() } else { b"\x89PNG\r\n\x1a\n".to_vec() };
            content.extend(bytes);
            std::fs::write(&path, content).unwrap();
            prop_assert!(DepthFile::read(&path).is_err());
        }
    }

    /// Bytes after the numbers are not used, even if the array is so small that they were read with the header.
    #[test]
    fn bytes_after_an_array_are_ignored() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a_depth.npy");
        for (side, more) in [(1, 1), (1, 9000), (100, 7)] {
            ndarray_npy::write_npy(&path, &ndarray::Array2::<f32>::ones((side, side))).unwrap();
            let whole = DepthFile::read(&path).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            bytes.resize(bytes.len() + more, 7);
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(DepthFile::read(&path).unwrap(), whole);
        }
    }

    #[test]
    fn truncated_files_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let map = DepthMap {
            width: 64,
            height: 32,
            data: (0..2048).map(|i| 1.0 + (i % 97) as f32).collect(),
        };
        let png = dir.path().join("a_depth.png");
        deepfusion_images::write_depth_png(&map, &png).unwrap();
        let npy = dir.path().join("a_depth.npy");
        ndarray_npy::write_npy(&npy, &ndarray::Array2::<f32>::ones((32, 64))).unwrap();
        for path in [png, npy] {
            let whole = std::fs::read(&path).unwrap();
            for keep in [0, 5, 9, 40, whole.len() / 2, whole.len() - 40] {
                std::fs::write(&path, &whole[..keep]).unwrap();
                let problem = DepthFile::read(&path).unwrap_err().to_string();
                assert!(problem.contains("a_depth"), "{keep}: {problem}");
            }
        }
    }

    #[test]
    fn an_array_with_an_impossible_shape_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a_depth.npy");
        for shape in [
            "(99999999, 99999999)",
            "(18446744073709551615, 2)",
            "(4000, 4000)",
            "(0, 5)",
            "(7,)",
            "(1, 2, 3)",
        ] {
            let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((text.len() as u16).to_le_bytes());
            bytes.extend(text.bytes());
            std::fs::write(&path, bytes).unwrap();
            assert!(
                matches!(DepthFile::read(&path), Err(Error::Content { .. })),
                "{shape}"
            );
        }
    }
}
