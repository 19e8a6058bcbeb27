//! A network's prediction for an image.

use std::sync::{Arc, Mutex, PoisonError};

use deepfusion::eval::IntervalFactors;
use deepfusion::geometry::cloud::PointCloud;
use deepfusion::geometry::{DepthMap, Intrinsics};
use deepfusion::images::RgbImage;
use deepfusion::jobs::intervals::sigma;
use numpy::{PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::arrays::{Plane, columns, image_array, once};
use crate::error::{raise, with_hint};
use crate::perceive::depth_map;

/// Positions and colours, N×3 each.
type Points<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u8>>);

/// Metric depth of an image.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Prediction {
    /// Depth, if it was computed in advance.
    made: Mutex<Option<DepthMap>>,
    prediction: deepfusion::Prediction,
    image: RgbImage,
    camera: Option<Intrinsics>,
    factors: Arc<IntervalFactors>,
    /// Each array is made once; later calls return the same one.
    depth: PyOnceLock<Plane>,
    sigma: PyOnceLock<Option<Plane>>,
    confidence: PyOnceLock<Option<Plane>>,
    disparity: PyOnceLock<Plane>,
}

impl Prediction {
    pub(crate) fn new(
        prediction: deepfusion::Prediction,
        image: RgbImage,
        camera: Option<Intrinsics>,
        factors: Arc<IntervalFactors>,
    ) -> Self {
        Self {
            made: Mutex::new(None),
            prediction,
            image,
            camera,
            factors,
            depth: PyOnceLock::new(),
            sigma: PyOnceLock::new(),
            confidence: PyOnceLock::new(),
            disparity: PyOnceLock::new(),
        }
    }

    /// Depth, and its calibrated standard deviation as the command writes it.
    fn stretched_sigma(&self) -> Option<(DepthMap, DepthMap)> {
        let depth = self.prediction.depth();
        let sigma = sigma(&self.prediction, &depth, &self.factors)?;
        Some((depth, sigma))
    }

    /// Whether the image's camera is known.
    pub(crate) fn knows_camera(&self) -> bool {
        self.camera.is_some()
    }

    /// Whether the network saw the whole image.
    pub(crate) fn saw_all(&self) -> bool {
        let [width, height] = self.prediction.image_size;
        self.prediction.window == [0, 0, width, height]
    }

    /// Computes the depth in advance.
    pub(crate) fn with_depth(self) -> Self {
        let made = Mutex::new(Some(self.prediction.depth()));
        Self { made, ..self }
    }
}

#[pymethods]
impl Prediction {
    /// H x W metres at the image's size; 0 outside the part that the network looked at. Computed once; always the same array.
    #[getter]
    pub(crate) fn depth(&self, py: Python<'_>) -> PyResult<Plane> {
        let array = self.depth.get_or_try_init(py, || {
            let made = self
                .made
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            let depth = made.unwrap_or_else(|| py.detach(|| self.prediction.depth()));
            image_array(py, depth.height, depth.width, depth.data)
        })?;
        Ok(array.clone_ref(py))
    }

    /// Standard deviation of `depth` in metres, H x W, scaled by what was found for the network, as `deepfusion predict` writes it;
    /// None for a network that does not predict it. Computed once; always the same array.
    #[getter]
    fn sigma(&self, py: Python<'_>) -> PyResult<Option<Plane>> {
        once(py, &self.sigma, || {
            self.stretched_sigma().map(|(_, sigma)| sigma)
        })
    }

    /// How far each pixel of `depth` can be trusted, H x W, 0 to 1: exp(-expected error of ln depth), 0.9 for 10 %; None for a
    /// network that does not predict it. Scaled like `sigma`. Computed once; always the same array.
    #[getter]
    fn confidence(&self, py: Python<'_>) -> PyResult<Option<Plane>> {
        once(py, &self.confidence, || {
            let (depth, sigma) = self.stretched_sigma()?;
            Some(deepfusion::Prediction::confidence_of(&depth, &sigma))
        })
    }

    /// Disparity in 1/m, at the network's size. Computed once; always the same array.
    #[getter]
    pub(crate) fn disparity(&self, py: Python<'_>) -> PyResult<Plane> {
        let array = self.disparity.get_or_try_init(py, || {
            let p = &self.prediction;
            image_array(py, p.height, p.width, p.disparity.clone())
        })?;
        Ok(array.clone_ref(py))
    }

    /// fx, fy, cx, cy of the image, if they are known.
    #[getter]
    fn intrinsics(&self) -> Option<(f64, f64, f64, f64)> {
        self.camera.map(|k| (k.fx, k.fy, k.cx, k.cy))
    }

    /// Exports `depth`: `torch.from_dlpack(prediction)` shares its memory.
    #[pyo3(signature = (**options))]
    fn __dlpack__<'py>(
        &self,
        py: Python<'py>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.depth(py)?
            .bind(py)
            .call_method("__dlpack__", (), options)
    }

    fn __dlpack_device__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.depth(py)?.bind(py).call_method0("__dlpack_device__")
    }

    /// `depth` itself: `np.asarray(prediction)` is this very array.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let depth = self.depth(py)?.into_bound(py).into_any();
        let converted = match dtype {
            None => depth.clone(),
            Some(dtype) => {
                let shared = PyDict::new(py);
                shared.set_item("copy", false)?;
                depth.call_method("astype", (dtype,), Some(&shared))?
            }
        };
        match (copy, converted.is(&depth)) {
            (Some(true), true) => converted.call_method0("copy"),
            (Some(false), false) => Err(PyValueError::new_err(
                "depth is float32: another dtype needs a copy",
            )),
            _ => Ok(converted),
        }
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a Prediction cannot be pickled: send its arrays, such as prediction.depth",
        ))
    }

    fn __repr__(&self) -> String {
        let [width, height] = self.prediction.image_size;
        let camera = if self.camera.is_some() {
            "known"
        } else {
            "assumed"
        };
        format!("Prediction({height} x {width}, camera {camera})")
    }

    /// Points, N x 3 in metres (x right, y down, z forward), and their colours, N x 3, from `depth` as it is now; needs
    /// `intrinsics`.
    #[pyo3(signature = (max_depth=80.0))]
    fn cloud<'py>(&self, py: Python<'py>, max_depth: f32) -> PyResult<Points<'py>> {
        let Some(camera) = self.camera else {
            return Err(with_hint(
                "a cloud needs the camera, and the camera of this image is unknown".into(),
                Some("give the camera: predict(image, intrinsics=(fx, fy, cx, cy))".into()),
            ));
        };
        let depth = depth_map(&self.depth(py)?.bind(py).try_readonly()?);
        let make = || PointCloud::from_depth(&depth, &camera, Some(&self.image), max_depth);
        let cloud = py.detach(make).map_err(raise)?;
        let points = cloud.xyz.len();
        let rgb = cloud.rgb.unwrap_or_default();
        Ok((
            columns(py, points, cloud.xyz.into_flattened())?,
            columns(py, rgb.len(), rgb.into_flattened())?,
        ))
    }
}
