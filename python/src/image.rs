//! Images given in Python: an array, a PIL image, a file, or a frame of a recording.

use std::path::PathBuf;
use std::sync::Arc;

use deepfusion::data::Dataset;
use deepfusion::geometry::Intrinsics;
use deepfusion::images::{RgbImage, exif_block_camera, load_photo};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::camera::AskedCamera;
use crate::dataset::Frame;
use crate::error::Failure;

/// Source of an image.
pub(crate) enum Source {
    /// Pixels in memory, and the camera from the EXIF data of the file that they were read from.
    Pixels(RgbImage, Option<Intrinsics>),
    /// A file.
    File(PathBuf),
    /// A frame of a recording, which has a camera.
    Frame(Arc<Dataset>, usize),
}

impl Source {
    /// From an array (NumPy's, or another's by DLPack), a PIL image, a path, or a frame.
    pub(crate) fn of(image: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(array) = image.extract::<PyReadonlyArray3<'_, u8>>() {
            return Ok(Self::Pixels(of_array(&array)?, None));
        }
        if let Ok(frame) = image.cast::<Frame>() {
            let (recording, index) = frame.get().source();
            return Ok(Self::Frame(recording, index));
        }
        if let Ok(path) = image.extract::<PathBuf>() {
            return Ok(Self::File(path));
        }
        let numpy = image.py().import("numpy")?;
        let mut exif = None;
        let array = if image.hasattr("__dlpack__")? {
            numpy.call_method1("from_dlpack", (image,))?
        } else if image.hasattr("convert")? {
            // PIL's interface, which other libraries also have.
            exif = exif_of_file(image)?;
            of_pil(&upright(image)?)?
        } else {
            numpy.call_method1("asarray", (image,))?
        };
        match array.extract::<PyReadonlyArray3<'_, u8>>() {
            Ok(array) => {
                let pixels = of_array(&array)?;
                let camera = exif.and_then(|exif| exif_block_camera(&exif, pixels.dimensions()));
                Ok(Self::Pixels(pixels, camera.map(|camera| camera.intrinsics)))
            }
            Err(_) => Err(no_image(&array)?),
        }
    }

    /// The pixels, and the camera: the one asked for, else the recording's or the one from EXIF.
    pub(crate) fn read(
        self,
        asked: AskedCamera,
    ) -> Result<(RgbImage, Option<Intrinsics>), Failure> {
        let (image, own) = match self {
            Self::Pixels(image, camera) => (image, camera),
            Self::File(path) => {
                let photo = load_photo(&path)?;
                (photo.image, photo.intrinsics)
            }
            Self::Frame(recording, index) => {
                let camera = recording.intrinsics(index);
                (recording.load_image(index)?, Some(camera))
            }
        };
        let given = asked.of(image.dimensions())?;
        Ok((image, given.or(own)))
    }
}

/// The error for an array that is not an image, with how to convert it.
fn no_image(array: &Bound<'_, PyAny>) -> PyResult<PyErr> {
    let kind = array.getattr("dtype")?.str()?.to_string();
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let hint = match shape.as_slice() {
        [_, _, 3] if kind.starts_with("float") => {
            ": if it is from 0 to 1, give (image * 255).astype(\"uint8\")"
        }
        [_, _] => ": for grey, give np.stack([image] * 3, -1) of uint8",
        [_, _, _, 3] => ": give several images to predict_many",
        [3, _, _] => ": give image.transpose(1, 2, 0) of uint8",
        _ => "",
    };
    Ok(PyTypeError::new_err(format!(
        "image: expected an H x W x 3 array of uint8, a PIL image, a path or a Frame, found {kind} {}{hint}",
        sizes(&shape)
    )))
}

fn sizes(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    if sizes.is_empty() {
        return "without a shape".into();
    }
    sizes.join(" x ")
}

/// The EXIF block of an image that PIL opened and that was not changed: after cropping, the focal length would be wrong.
fn exif_of_file(image: &Bound<'_, PyAny>) -> PyResult<Option<Vec<u8>>> {
    let Ok(pil) = image.py().import("PIL.ImageFile") else {
        return Ok(None);
    };
    if !image.is_instance(&pil.getattr("ImageFile")?)? {
        return Ok(None);
    }
    // A PNG may have EXIF data after its pixels.
    image.call_method0("load")?;
    let block = image.getattr("info")?.call_method1("get", ("exif",))?;
    Ok(block.extract().ok())
}

/// A PIL image rotated according to its EXIF data, as images are when the library reads a file.
fn upright<'py>(image: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    if !image.hasattr("getexif")? {
        return Ok(image.clone());
    }
    py.import("PIL.ImageOps")?
        .call_method1("exif_transpose", (image,))
}

/// The pixels of a PIL image, H x W x 3. PIL's own conversion clips 16-bit grey at 255; here it is scaled to 8 bits, as when reading a file.
fn of_pil<'py>(image: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let numpy = py.import("numpy")?;
    // Objects that only have PIL's interface may lack a mode.
    let mode = image.getattr("mode").ok();
    let mode: Option<String> = mode.and_then(|mode| mode.extract().ok());
    match mode.as_deref() {
        Some(mode) if mode.starts_with("I;16") => {
            let grey = numpy.call_method1("asarray", (image, "uint16"))?;
            let grey: PyReadonlyArray2<'_, u16> = grey.extract()?;
            let grey = grey.as_array();
            let size = (grey.nrows(), grey.ncols(), 3);
            let eight_bits = |value: u16| ((u32::from(value) + 128) / 257) as u8;
            let rgb =
                Array3::from_shape_fn(size, |(row, column, _)| eight_bits(grey[(row, column)]));
            Ok(rgb.into_pyarray(py).into_any())
        }
        Some(mode @ ("I" | "F")) => Err(PyTypeError::new_err(format!(
            "image: a PIL image of mode {mode:?} has no fixed range: give one of 8 bits or an array of uint8"
        ))),
        _ => {
            let rgb = image.call_method1("convert", ("RGB",))?;
            numpy.call_method1("asarray", (rgb,))
        }
    }
}

fn of_array(array: &PyReadonlyArray3<'_, u8>) -> PyResult<RgbImage> {
    let [height, width, channels] = [0, 1, 2].map(|axis| array.shape()[axis]);
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    let (Some((w, h)), 3, true) = (size, channels, width > 0 && height > 0) else {
        let hint = match (height, channels) {
            (_, 4) => ": give image[..., :3], without the fourth channel",
            (_, 1) => ": give np.concatenate([image] * 3, -1), grey in three channels",
            (3, _) => ": give image.transpose(1, 2, 0)",
            _ => "",
        };
        let message = format!(
            "image: expected H x W x 3 of uint8, found uint8 {height} x {width} x {channels}{hint}"
        );
        return Err(PyValueError::new_err(message));
    };
    let bytes: Vec<u8> = match array.as_slice() {
        Ok(bytes) if array.is_c_contiguous() => bytes.to_vec(),
        // Rows or channels in another order, or a part of a larger array.
        _ => array.as_array().iter().copied().collect(),
    };
    RgbImage::from_raw(w, h, bytes)
        .ok_or_else(|| PyValueError::new_err("image: its size does not match its bytes"))
}
