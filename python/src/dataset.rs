//! Recordings.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::slice;
use std::sync::Arc;

use deepfusion::data::{self, GtKind, OpenOptions};
use deepfusion::jobs::evaluation::missing_frames;
use deepfusion::jobs::recordings::warnings_of;
use deepfusion::jobs::scene::{Motion, motion_known, yaw_rate};
use nalgebra::Vector3;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PySlice};

use crate::arrays::image_array;
use crate::camera::GivenCamera;
use crate::error::{Failure, raise, warn, with_hint};
use crate::interrupt::abandonable;
use crate::opening::{Opening, absolute};

/// What pickle calls to restore an object, and the arguments.
type Reduced<'py, A> = (Bound<'py, PyAny>, A);

/// A recording of any known layout: one drive, one camera. `recording[i]` reads nothing but what is known about the frame.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Dataset {
    inner: Arc<data::Dataset>,
    /// Absolute; with `drive` and `opening`, it opens the recording again in another process.
    path: PathBuf,
    drive: usize,
    opening: Opening,
    /// Folder of its files, absolute.
    folder: PathBuf,
    /// Warnings about the recording.
    warnings: Vec<String>,
}

/// Every drive below `path`, each opened as a `Dataset`; the options apply to all of them.
#[pyfunction]
#[pyo3(signature = (path, *, camera="2", intrinsics=None, hfov_deg=None, calibration=None, topics=None, clock_offset_ms=None, split=None))]
#[expect(clippy::too_many_arguments, reason = "by name in Python")]
pub(crate) fn drives(
    py: Python<'_>,
    path: PathBuf,
    camera: &str,
    intrinsics: Option<GivenCamera>,
    hfov_deg: Option<f64>,
    calibration: Option<PathBuf>,
    topics: Option<&Bound<'_, PyAny>>,
    clock_offset_ms: Option<f64>,
    split: Option<PathBuf>,
) -> PyResult<Vec<Dataset>> {
    let opening = Opening::new(intrinsics, hfov_deg, topics, clock_offset_ms)?;
    let opening = opening.of_dataset(camera, calibration, split)?;
    let all = opened(py, &path, &opening)?.into_iter().enumerate();
    let one = |(drive, inner)| Dataset::of(py, inner, (path.as_path(), drive), opening.clone());
    all.map(one).collect()
}

/// Opens the recordings below a path, and warns of a split's frames that do not exist.
fn opened(py: Python<'_>, path: &Path, opening: &Opening) -> PyResult<Vec<data::Dataset>> {
    let (path, opening) = (path.to_owned(), opening.clone());
    // Opening a large recording takes long.
    let open = move || -> Result<_, Failure> {
        let options = opening.options()?;
        let all = data::Dataset::open(&path, &options)?;
        let missing = missing_frames(&options, &all).map(|missing| missing.to_string());
        Ok((all, missing))
    };
    let (all, missing) = abandonable(py, open)??;
    if let Some(missing) = missing {
        warn(py, &missing)?;
    }
    Ok(all)
}

impl Dataset {
    /// Wraps the drive with this number below a path, and issues its warnings in Python.
    fn of(
        py: Python<'_>,
        inner: data::Dataset,
        (path, drive): (&Path, usize),
        opening: Opening,
    ) -> PyResult<Self> {
        let warnings = warnings_of(&OpenOptions::default(), slice::from_ref(&inner));
        for warning in &warnings {
            warn(py, warning)?;
        }
        Ok(Self {
            folder: absolute(inner.folder().to_owned()),
            inner: Arc::new(inner),
            path: absolute(path.to_owned()),
            drive,
            opening,
            warnings,
        })
    }

    /// The position of a frame by its index, which counts from the end if negative.
    fn place(&self, index: isize) -> PyResult<usize> {
        let count = self.__len__();
        let place = match index {
            0.. => Some(index.unsigned_abs()),
            _ => count.checked_add_signed(index),
        };
        let place = place.filter(|place| *place < count);
        place.ok_or_else(|| PyIndexError::new_err(format!("frame {index} of {count}")))
    }

    /// What is known of each frame.
    fn facts(&self) -> impl Iterator<Item = &data::Frame> {
        let frames = self.inner.frames();
        self.inner.selected().iter().map(|index| &frames[*index])
    }

    /// A number of each frame, NaN if unknown.
    fn column<'py>(
        &self,
        py: Python<'py>,
        number: fn(&data::Frame) -> Option<f64>,
    ) -> Bound<'py, PyArray1<f64>> {
        let numbers = self.facts().map(|frame| number(frame).unwrap_or(f64::NAN));
        numbers.collect::<Vec<f64>>().into_pyarray(py)
    }
}

#[pymethods]
impl Dataset {
    #[new]
    #[pyo3(signature = (path, *, camera="2", drive=0, intrinsics=None, hfov_deg=None, calibration=None, topics=None, clock_offset_ms=None, split=None))]
    #[expect(clippy::too_many_arguments, reason = "by name in Python")]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        camera: &str,
        drive: usize,
        intrinsics: Option<GivenCamera>,
        hfov_deg: Option<f64>,
        calibration: Option<PathBuf>,
        topics: Option<&Bound<'_, PyAny>>,
        clock_offset_ms: Option<f64>,
        split: Option<PathBuf>,
    ) -> PyResult<Self> {
        let opening = Opening::new(intrinsics, hfov_deg, topics, clock_offset_ms)?;
        let opening = opening.of_dataset(camera, calibration, split)?;
        let mut all = opened(py, &path, &opening)?;
        if drive >= all.len() {
            let message = format!("{}: drive {drive} of {}", path.display(), all.len());
            let hint = "count drives from 0, give the folder of one drive, or open all of them with drives(path)".to_owned();
            return Err(with_hint(message, Some(hint)));
        }
        Self::of(py, all.swap_remove(drive), (path.as_path(), drive), opening)
    }

    fn __len__(&self) -> usize {
        self.inner.selected().len()
    }

    fn __getitem__<'py>(
        slf: &Bound<'py, Self>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, dataset) = (slf.py(), slf.get());
        let frame = |place| Frame {
            dataset: slf.clone().unbind(),
            place,
        };
        let Ok(slice) = index.cast::<PySlice>() else {
            let place = dataset.place(index.extract()?)?;
            return Ok(Bound::new(py, frame(place))?.into_any());
        };
        let count = isize::try_from(dataset.__len__())?;
        let part = slice.indices(count)?;
        // A slice within the sequence has valid positions only.
        let places = (0..part.slicelength).map(|n| {
            part.start
                .unsigned_abs()
                .wrapping_add_signed(n as isize * part.step)
        });
        let frames: Vec<Frame> = places.map(frame).collect();
        Ok(PyList::new(py, frames)?.into_any())
    }

    /// How far the camera looks to the left of straight ahead, in radians; 0 if nothing says how it is mounted, None for a camera
    /// that looks to the side or back (more than 60 degrees).
    #[getter]
    fn camera_yaw_rad(&self) -> Option<f64> {
        let mount = self.inner.cam_from_vehicle();
        let mounted = Motion {
            ahead_in_cam: mount.map(|cam_from_vehicle| cam_from_vehicle.rotate(&Vector3::x())),
            ..Motion::default()
        };
        mounted.camera_yaw()
    }

    fn __iter__(slf: &Bound<'_, Self>) -> Frames {
        Frames {
            dataset: slf.clone().unbind(),
            next: 0,
        }
    }

    /// Name of the drive.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    /// The recording's layout, such as "KITTI raw".
    #[getter]
    fn layout(&self) -> &'static str {
        self.inner.kind().label()
    }

    /// When each frame was taken, in seconds from the recording's first time stamp; NaN if that is not known.
    #[getter]
    fn times_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |frame| frame.time_s)
    }

    /// The vehicle's speed at each frame; NaN if that is not known.
    #[getter]
    fn speeds_mps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |frame| frame.speed_mps)
    }

    /// Number of each frame in the recording's files.
    #[getter]
    fn numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let numbers = self
            .facts()
            .map(|frame| i64::try_from(frame.number).unwrap_or(i64::MAX));
        numbers.collect::<Vec<i64>>().into_pyarray(py)
    }

    /// What was assumed, looks odd or could not be read although the recording was opened, one line each. `Dataset(...)` issues
    /// them as warnings (UserWarning).
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// 4 x 4, target_from_source: transforms a point from the camera at frame `source` to the camera at frame `target`; None if the
    /// vehicle's motion is not known. Negative numbers count frames from the end, as in `recording[-1]`.
    fn motion<'py>(
        &self,
        py: Python<'py>,
        source: isize,
        target: isize,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let frames = self.inner.selected();
        let (source, target) = (frames[self.place(source)?], frames[self.place(target)?]);
        let motion = py.detach(|| self.inner.camera_motion(target, source));
        Ok(motion.map(|target_from_source| {
            let m = target_from_source.matrix();
            Array2::from_shape_fn((4, 4), |(row, column)| m[(row, column)]).into_pyarray(py)
        }))
    }

    /// Unpickling opens it again: the recording itself stays where it is.
    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((PathBuf,), Bound<'py, PyDict>)> {
        let named = self.opening.arguments(py)?;
        named.set_item("drive", self.drive)?;
        Ok(((self.path.clone(),), named))
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
    dataset: Py<Dataset>,
    next: usize,
}

#[pymethods]
impl Frames {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&mut self, py: Python<'_>) -> Option<Frame> {
        let place = self.next;
        if place >= self.dataset.get().__len__() {
            return None;
        }
        self.next += 1;
        Some(Frame {
            dataset: self.dataset.clone_ref(py),
            place,
        })
    }
}

/// One frame of a recording.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Frame {
    /// The Python object, so that frames that are pickled together share one recording.
    dataset: Py<Dataset>,
    /// Position among the selected frames.
    place: usize,
}

impl Frame {
    fn data(&self) -> &data::Dataset {
        &self.dataset.get().inner
    }

    /// Index among all frames.
    fn index(&self) -> usize {
        self.data().selected()[self.place]
    }

    fn facts(&self) -> &data::Frame {
        &self.data().frames()[self.index()]
    }

    /// The recording and the frame's index in it, for another thread.
    pub(crate) fn source(&self) -> (Arc<data::Dataset>, usize) {
        (Arc::clone(&self.dataset.get().inner), self.index())
    }
}

#[pymethods]
impl Frame {
    /// H x W x 3, RGB, without lens distortion. Read on each access.
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let image = py
            .detach(|| self.data().load_image(self.index()))
            .map_err(raise)?;
        let (width, height) = image.dimensions();
        let shape = (height as usize, width as usize, 3);
        let array = Array3::from_shape_vec(shape, image.into_raw());
        let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok(array.into_pyarray(py))
    }

    /// Number of the frame in the recording's files.
    #[getter]
    fn number(&self) -> u64 {
        self.facts().number
    }

    /// When it was taken, in seconds from the recording's first time stamp.
    #[getter]
    fn time_s(&self) -> Option<f64> {
        self.facts().time_s
    }

    /// Speed of the vehicle.
    #[getter]
    fn speed_mps(&self) -> Option<f64> {
        self.facts().speed_mps
    }

    /// How fast the vehicle turned since the previous frame, in radians per second, positive to the left; None if that is not
    /// known, and for the first frame.
    #[getter]
    fn yaw_rate_radps(&self) -> Option<f64> {
        let (dataset, index) = (self.data(), self.index());
        let last = dataset.selected()[self.place.checked_sub(1)?];
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
        let k = self.data().intrinsics(self.index());
        (k.fx, k.fy, k.cx, k.cy)
    }

    /// `intrinsics` as the 3 x 3 matrix fx 0 cx, 0 fy cy, 0 0 1, float64.
    #[getter(K)]
    fn matrix<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (fx, fy, cx, cy) = self.intrinsics();
        let k = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
        Array2::from_shape_fn((3, 3), |(row, column)| k[row][column]).into_pyarray(py)
    }

    /// H x W metres, 0 where nothing was measured; None if the frame has no ground truth. `kind`: "z", "velodyne" or "annotated"
    /// (KITTI's `proj_depth`).
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
        let read = || self.data().ground_truth(self.index(), kind);
        let truth = py.detach(|| deepfusion_cli::in_this_process(read));
        let truth = truth.map_err(raise)?;
        truth
            .map(|depth| image_array(py, depth.height, depth.width, depth.data))
            .transpose()
    }

    /// The same frame of the same recording, wherever that was opened.
    fn __eq__(&self, other: PyRef<'_, Self>) -> bool {
        let (own, others) = (self.dataset.get(), other.dataset.get());
        let same = |a: &Dataset, b: &Dataset| {
            a.folder == b.folder
                && (a.inner.name(), a.inner.camera()) == (b.inner.name(), b.inner.camera())
                // Bags of one name side by side, and the cameras of one bag.
                && a.opening.topics() == b.opening.topics()
        };
        let file = |frame: &Self| frame.facts().image.path().to_owned();
        self.index() == other.index() && same(own, others) && file(self) == file(&other)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (self.data().name(), self.index()).hash(&mut hasher);
        hasher.finish()
    }

    /// Unpickling opens the recording again and gives the same frame.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py, (Py<Dataset>, usize)>> {
        let of = py.import("operator")?.getattr("getitem")?;
        Ok((of, (self.dataset.clone_ref(py), self.place)))
    }

    fn __repr__(&self) -> String {
        let (number, name) = (self.facts().number, self.data().name());
        match self.facts().time_s {
            Some(time_s) => format!("Frame({number} of {name:?}, {time_s:.3} s)"),
            None => format!("Frame({number} of {name:?})"),
        }
    }
}
