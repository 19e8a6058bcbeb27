//! Options for opening a recording that `Dataset`, `drives` and `doctor` have in common.

use std::path::PathBuf;

use deepfusion::data::{Cameras, NamedTopic, OpenOptions};
use deepfusion::jobs::recordings::{camera_word, read_split};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};

use crate::camera::{GivenCamera, numbers_of};
use crate::error::Failure;

/// Options that replace what the recording itself contains.
#[derive(Clone, Default)]
pub(crate) struct Opening {
    camera: Cameras,
    intrinsics: Option<[f64; 4]>,
    hfov_deg: Option<f64>,
    /// Absolute, like `split`, since the options may be sent to another process.
    calibration: Option<PathBuf>,
    topics: Vec<NamedTopic>,
    clock_offset_ms: Option<f64>,
    split: Option<PathBuf>,
}

impl Opening {
    /// The named topics.
    pub(crate) fn topics(&self) -> &[NamedTopic] {
        &self.topics
    }

    pub(crate) fn new(
        intrinsics: Option<GivenCamera>,
        hfov_deg: Option<f64>,
        topics: Option<&Bound<'_, PyAny>>,
        clock_offset_ms: Option<f64>,
    ) -> PyResult<Self> {
        let intrinsics = numbers_of(intrinsics)?;
        if intrinsics.is_some() && hfov_deg.is_some() {
            let message = "intrinsics and hfov_deg both describe the camera: give only one of them";
            return Err(PyValueError::new_err(message));
        }
        Ok(Self {
            intrinsics,
            hfov_deg,
            topics: topics.map(named_topics).transpose()?.unwrap_or_default(),
            clock_offset_ms,
            ..Self::default()
        })
    }

    /// Adds one of two cameras, a calibration file and a split.
    pub(crate) fn of_dataset(
        self,
        camera: &str,
        calibration: Option<PathBuf>,
        split: Option<PathBuf>,
    ) -> PyResult<Self> {
        let one = |camera: &Cameras| *camera != Cameras::Both;
        let camera = camera.parse().ok().filter(one).ok_or_else(|| {
            PyValueError::new_err(format!("camera: expected \"2\" or \"3\", found {camera:?}"))
        })?;
        Ok(Self {
            camera,
            calibration: calibration.map(absolute),
            split: split.map(absolute),
            ..self
        })
    }

    /// As the library's options.
    pub(crate) fn options(&self) -> Result<OpenOptions, Failure> {
        Ok(OpenOptions {
            camera: self.camera,
            split: read_split(self.split.as_deref())?,
            intrinsics: self.intrinsics,
            hfov_deg: self.hfov_deg,
            calibration: self.calibration.clone(),
            camera_ahead_s: self.clock_offset_ms.map(|ms| ms / 1e3),
            topics: self.topics.clone(),
            ..OpenOptions::default()
        })
    }

    /// Whether anything but the camera's number and the frames is set.
    pub(crate) fn says_something(&self) -> bool {
        let camera = self.intrinsics.is_some() || self.hfov_deg.is_some();
        let camera = camera || self.calibration.is_some();
        camera || !self.topics.is_empty() || self.clock_offset_ms.is_some()
    }

    /// The keyword arguments that give the same options.
    pub(crate) fn arguments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let named = PyDict::new(py);
        named.set_item("camera", camera_word(self.camera))?;
        named.set_item("intrinsics", self.intrinsics)?;
        named.set_item("hfov_deg", self.hfov_deg)?;
        named.set_item("calibration", self.calibration.as_ref())?;
        let topics = PyDict::new(py);
        for topic in &self.topics {
            topics.set_item(topic.role.name(), &topic.topic)?;
        }
        named.set_item("topics", topics)?;
        named.set_item("clock_offset_ms", self.clock_offset_ms)?;
        named.set_item("split", self.split.as_ref())?;
        Ok(named)
    }
}

/// Parses a mapping from roles to topics.
fn named_topics(topics: &Bound<'_, PyAny>) -> PyResult<Vec<NamedTopic>> {
    let wrong = |_: PyErr| {
        PyTypeError::new_err(
            "topics: expected a dict from roles to topics, such as {\"image\": \"/camera/image\"}",
        )
    };
    let topics = topics.cast::<PyMapping>().map_err(|e| wrong(e.into()))?;
    let pairs: Vec<(String, String)> = topics.items()?.extract().map_err(wrong)?;
    let named = |(role, topic): (String, String)| {
        let topic = format!("{role}={topic}").parse::<NamedTopic>();
        topic.map_err(|problem| PyValueError::new_err(format!("topics: {problem}")))
    };
    pairs.into_iter().map(named).collect()
}

/// The absolute path, which is the same from any folder.
pub(crate) fn absolute(path: PathBuf) -> PathBuf {
    std::path::absolute(&path).unwrap_or(path)
}
