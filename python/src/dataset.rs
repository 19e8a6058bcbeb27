//! Recordings.

use std::path::PathBuf;
use std::slice;
use std::sync::Arc;

use deepfusion::data::{self, Cameras, GtKind, OpenOptions};
use deepfusion::jobs::recordings::warnings_of;
use deepfusion::jobs::scene::{Motion, motion_known, yaw_rate};
use nalgebra::Vector3;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::error::{raise, warn, with_hint};
use crate::interrupt::abandonable;
use crate::model::image_array;

/// A recording of any known layout: one drive, one camera.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Dataset {
    inner: Arc<data::Dataset>,
    /// What may not be meant of it.
    warnings: Vec<String>,
}

#[pymethods]
impl Dataset {
    #[new]
    #[pyo3(signature = (path, *, camera="2", drive=0))]
    fn new(py: Python<'_>, path: PathBuf, camera: &str, drive: usize) -> PyResult<Self> {
        let one = |camera: &Cameras| *camera != Cameras::Both;
        let camera = camera.parse().ok().filter(one).ok_or_else(|| {
            PyValueError::new_err(format!("camera: expected \"2\" or \"3\", found {camera:?}"))
        })?;
        let options = OpenOptions {
            camera,
            ..OpenOptions::default()
        };
        // A large recording takes long to look through.
        let given = path.clone();
        let open = move || data::Dataset::open(&given, &options);
        let mut all = abandonable(py, open)?.map_err(raise)?;
        if drive >= all.len() {
            let message = format!("{}: drive {drive} of {}", path.display(), all.len());
            let hint = "drives are counted from 0; give the folder of one drive".to_owned();
            return Err(with_hint(message, Some(hint)));
        }
        let inner = all.swap_remove(drive);
        let warnings = warnings_of(&OpenOptions::default(), slice::from_ref(&inner));
        for warning in &warnings {
            warn(py, warning)?;
        }
        Ok(Self {
            inner: Arc::new(inner),
            warnings,
        })
    }

    fn __len__(&self) -> usize {
        self.inner.selected().len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Frame> {
        let frames = self.inner.selected();
        let from_end = |i: isize| frames.len().checked_add_signed(i);
        let place = match index {
            0.. => Some(index.unsigned_abs()),
            _ => from_end(index),
        };
        let found = place.and_then(|place| frames.get(place));
        let found = found
            .ok_or_else(|| PyIndexError::new_err(format!("frame {index} of {}", frames.len())))?;
        Ok(Frame {
            dataset: Arc::clone(&self.inner),
            index: *found,
        })
    }

    /// By how much the camera looks to the left of the way straight ahead, radians; 0 where nothing says its mount, None for one that
    /// looks to the side or back (more than 60 degrees).
    #[getter]
    fn camera_yaw_rad(&self) -> Option<f64> {
        let mount = self.inner.cam_from_vehicle();
        let mounted = Motion {
            ahead_in_cam: mount.map(|cam_from_vehicle| cam_from_vehicle.rotate(&Vector3::x())),
            ..Motion::default()
        };
        mounted.camera_yaw()
    }

    fn __iter__(&self) -> Frames {
        Frames {
            dataset: Arc::clone(&self.inner),
            next: 0,
        }
    }

    /// The drive's.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    /// Such as "KITTI raw".
    #[getter]
    fn layout(&self) -> &'static str {
        self.inner.kind().label()
    }

    /// What was taken for granted, looks odd or cannot be read, though it was opened: a line each. `Dataset(...)` warns of them (UserWarning).
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// 4 x 4, target_from_source: takes a point of the camera at frame `source` to the camera at frame `target`; None where
    /// the vehicle's motion is not known.
    fn motion<'py>(
        &self,
        py: Python<'py>,
        source: usize,
        target: usize,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let frames = self.inner.selected();
        let place = |i: usize| {
            let place = frames.get(i).copied();
            place.ok_or_else(|| PyIndexError::new_err(format!("frame {i} of {}", frames.len())))
        };
        let (source, target) = (place(source)?, place(target)?);
        let motion = py.detach(|| self.inner.camera_motion(target, source));
        Ok(motion.map(|target_from_source| {
            let m = target_from_source.matrix();
            Array2::from_shape_fn((4, 4), |(row, column)| m[(row, column)]).into_pyarray(py)
        }))
    }

    fn __repr__(&self) -> String {
        let (name, frames) = (self.inner.name(), self.__len__());
        let s = if frames == 1 { "" } else { "s" };
        format!("Dataset({name:?}, {frames} frame{s}, {})", self.layout())
    }
}

/// The frames of a recording, one after another.
#[pyclass(module = "deepfusion._native")]
struct Frames {
    dataset: Arc<data::Dataset>,
    next: usize,
}

#[pymethods]
impl Frames {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&mut self) -> Option<Frame> {
        let index = *self.dataset.selected().get(self.next)?;
        self.next += 1;
        Some(Frame {
            dataset: Arc::clone(&self.dataset),
            index,
        })
    }
}

/// One frame of a recording.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Frame {
    dataset: Arc<data::Dataset>,
    index: usize,
}

impl Frame {
    fn facts(&self) -> &data::Frame {
        &self.dataset.frames()[self.index]
    }
}

#[pymethods]
impl Frame {
    /// H x W x 3, RGB, free of the lens's distortion. Read when asked for.
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let image = py
            .detach(|| self.dataset.load_image(self.index))
            .map_err(raise)?;
        let (width, height) = image.dimensions();
        let shape = (height as usize, width as usize, 3);
        let array = Array3::from_shape_vec(shape, image.into_raw());
        let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok(array.into_pyarray(py))
    }

    /// Its number in the recording's files.
    #[getter]
    fn number(&self) -> u64 {
        self.facts().number
    }

    /// When it was taken, seconds from the recording's first stamp.
    #[getter]
    fn time_s(&self) -> Option<f64> {
        self.facts().time_s
    }

    /// The vehicle's.
    #[getter]
    fn speed_mps(&self) -> Option<f64> {
        self.facts().speed_mps
    }

    /// How fast the vehicle turned since the frame before, radians a second, positive to the left; None where that is not known, and of the
    /// first frame.
    #[getter]
    fn yaw_rate_radps(&self) -> Option<f64> {
        let (dataset, index) = (&self.dataset, self.index);
        let place = dataset.selected().iter().position(|i| *i == index)?;
        let last = *dataset.selected().get(place.checked_sub(1)?)?;
        if !motion_known(dataset) {
            return None;
        }
        let last_from_this = dataset.camera_motion(last, index)?;
        let seconds = self.facts().time_s? - dataset.frames()[last].time_s?;
        Some(yaw_rate(&last_from_this, seconds))
    }

    /// fx, fy, cx, cy in pixels of `image`.
    #[getter]
    fn intrinsics(&self) -> (f64, f64, f64, f64) {
        let k = self.dataset.intrinsics(self.index);
        (k.fx, k.fy, k.cx, k.cy)
    }

    /// H x W metres, 0 where nothing was measured; None where the frame has none. `kind`: "z", "velodyne" or
    /// "annotated" (KITTI's `proj_depth`).
    #[pyo3(signature = (kind="z"))]
    fn ground_truth(&self, py: Python<'_>, kind: &str) -> PyResult<Option<Py<PyArray2<f32>>>> {
        let kind = match kind {
            "z" => GtKind::Z,
            "velodyne" => GtKind::Velodyne,
            "annotated" => GtKind::Annotated,
            other => {
                let message =
                    format!("kind: expected \"z\", \"velodyne\" or \"annotated\", found {other:?}");
                return Err(PyValueError::new_err(message));
            }
        };
        let read = || self.dataset.ground_truth(self.index, kind);
        let truth = py.detach(|| deepfusion_cli::in_this_process(read));
        let truth = truth.map_err(raise)?;
        truth
            .map(|depth| image_array(py, depth.height, depth.width, depth.data))
            .transpose()
    }
}
