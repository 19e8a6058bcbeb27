//! Results as NumPy arrays.

use deepfusion::geometry::DepthMap;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// An array of H x W.
pub(crate) type Plane = Py<PyArray2<f32>>;

/// The array of a map, made at the first call.
pub(crate) fn once(
    py: Python<'_>,
    place: &PyOnceLock<Option<Plane>>,
    make: impl FnOnce() -> Option<DepthMap> + Send,
) -> PyResult<Option<Plane>> {
    let array = place.get_or_try_init(py, || {
        let map = py.detach(make);
        map.map(|map| image_array(py, map.height, map.width, map.data))
            .transpose()
    })?;
    Ok(array.as_ref().map(|array| array.clone_ref(py)))
}

/// N×3, without a copy.
pub(crate) fn columns<T: numpy::Element>(
    py: Python<'_>,
    rows: usize,
    values: Vec<T>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let array = Array2::from_shape_vec((rows, 3), values);
    let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// H×W, without a copy.
pub(crate) fn image_array(
    py: Python<'_>,
    height: usize,
    width: usize,
    values: Vec<f32>,
) -> PyResult<Plane> {
    let array = Array2::from_shape_vec((height, width), values);
    let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py).unbind())
}
