//! Evaluation, simulated drives and the doctor.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use deepfusion::Hint;
use deepfusion::doctor::{Diagnosis, doctor_log, doctor_with, is_log};
use deepfusion::eval::{
    Crop, Error, Evaluator, Grid, GroundTruth, Holes, Prediction as Predicted, Protocol, Scaling,
};
use deepfusion::logs::ReadOptions;
use deepfusion::sim::{Scene, SimConfig, Simulation, write_kitti};
use numpy::{PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::camera::GivenCamera;
use crate::error::{Failure, raise, with_hint};
use crate::interrupt::{Stop, abandonable, interruptible};
use crate::opening::Opening;
use crate::prediction::Prediction;

/// Compares predictions with ground truth, one image at a time.
#[pyclass(frozen, module = "deepfusion._native")]
pub(crate) struct Evaluation {
    evaluator: Mutex<Evaluator>,
    of_disparity: bool,
}

#[pymethods]
impl Evaluation {
    #[new]
    #[pyo3(signature = (kind, crop, cap, min_depth, allow_holes, gt_depth, scale, points, points_seed))]
    #[expect(clippy::too_many_arguments, reason = "by name in Python")]
    fn new(
        kind: &str,
        crop: &str,
        cap: f64,
        min_depth: f64,
        allow_holes: bool,
        gt_depth: &str,
        scale: Option<f64>,
        points: usize,
        points_seed: u64,
    ) -> PyResult<Self> {
        let of_disparity = match kind {
            "depth" => false,
            "disparity" => true,
            other => return Err(unknown("kind", "\"depth\" or \"disparity\"", other)),
        };
        let crop = match crop {
            "none" => Crop::None,
            "garg" => Crop::Garg,
            other => return Err(unknown("crop", "\"none\" or \"garg\"", other)),
        };
        let gt = match gt_depth {
            "z" => GroundTruth::Z,
            "velodyne" => GroundTruth::Velodyne,
            "annotated" => GroundTruth::Annotated,
            other => {
                let known = "\"z\", \"velodyne\" or \"annotated\"";
                return Err(unknown("gt_depth", known, other));
            }
        };
        let protocol = Protocol {
            crop,
            cap_m: cap,
            min_m: min_depth,
            gt,
            scaling: scale.map_or(Scaling::None, Scaling::Fixed),
            holes: if allow_holes {
                Holes::Skip
            } else {
                Holes::Refuse
            },
            points,
            points_seed,
            ..Protocol::default()
        };
        Ok(Self {
            evaluator: Mutex::new(Evaluator::new(protocol).map_err(raise)?),
            of_disparity,
        })
    }

    /// `prediction` is a `Prediction`, or an array of H x W.
    fn add(
        &self,
        py: Python<'_>,
        name: &str,
        prediction: &Bound<'_, PyAny>,
        truth: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        let predicted = match prediction.cast::<Prediction>() {
            Ok(seen) => self.seen(py, name, seen.get())?,
            Err(_) => grid(&prediction.extract::<PyReadonlyArray2<'_, f64>>()?)?,
        };
        let predicted = if self.of_disparity {
            Predicted::Disparity(predicted)
        } else {
            Predicted::Depth(predicted)
        };
        let truth = grid(&truth)?;
        let added = py.detach(|| {
            let mut evaluator = self
                .evaluator
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            evaluator.add(name, &predicted, &truth).map(|_| ())
        });
        added.map_err(refused)?;
        py.check_signals()
    }

    /// The report as JSON, as `deepfusion eval --json` prints it.
    fn report(&self) -> PyResult<String> {
        let evaluator = self
            .evaluator
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let report = evaluator.report().map_err(raise)?;
        serde_json::to_string(&report).map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

impl Evaluation {
    /// The values of a network's prediction that are compared: its arrays in their current state.
    fn seen(&self, py: Python<'_>, name: &str, seen: &Prediction) -> PyResult<Grid> {
        if !self.of_disparity {
            return grid(&seen.depth(py)?.bind(py).try_readonly()?);
        }
        if !seen.saw_all() {
            return Err(with_hint(
                format!(
                    "prediction `{name}` covers only a part of its image, and so does its disparity"
                ),
                Some("predict the whole image with stretch=True, or evaluate with kind=\"depth\", allow_holes=True".into()),
            ));
        }
        grid(&seen.disparity(py)?.bind(py).try_readonly()?)
    }
}

/// An error of the evaluation, with a hint for Python.
fn refused(error: Error) -> PyErr {
    let hint = match &error {
        Error::InvalidPrediction { kind, .. } => Some(format!(
            "a network's {kind} is positive everywhere; if these values mean \"no prediction\", give allow_holes=True, which leaves them out and \
             counts them in missing_rate, or predict the whole image with predict(image, stretch=True)"
        )),
        other => other.hint(),
    };
    with_hint(error.to_string(), hint)
}

fn unknown(what: &str, expected: &str, found: &str) -> PyErr {
    PyValueError::new_err(format!("{what}: expected {expected}, found {found:?}"))
}

fn grid<T: numpy::Element + Copy + Into<f64>>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Grid> {
    let (height, width) = (array.shape()[0], array.shape()[1]);
    let values = array.as_array().into_iter().map(|value| (*value).into());
    Grid::new(width, height, values.collect()).map_err(raise)
}

/// Writes a simulated drive and returns its folder.
#[expect(clippy::too_many_arguments, reason = "by name in Python")]
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    out: PathBuf,
    frames: usize,
    seed: u64,
    scene: &str,
    moving_cars: usize,
    riders: usize,
    varied: bool,
    width: u32,
    height: u32,
    scan_every: usize,
) -> PyResult<PathBuf> {
    let scene = Scene::EVERY.into_iter().find(|known| known.name() == scene);
    let scene = scene.ok_or_else(|| {
        let names = Scene::ALL.map(Scene::name).join(", ");
        with_hint(
            "scene: no scene of this name".into(),
            Some(format!(
                "give one of {names}, or, with varied=True, motorway or country"
            )),
        )
    })?;
    let config = SimConfig {
        seed,
        frames,
        width,
        height,
        moving_cars,
        riders,
        varied,
        scene,
        scan_every,
        ..SimConfig::default()
    };
    let write = |stop: &Stop| {
        let simulation = Simulation::new(&config)?;
        write_kitti(&simulation, &out, &mut |_, _| stop.flow())
    };
    interruptible(py, write)?.map_err(raise)
}

/// What `deepfusion doctor PATH` finds, as JSON.
#[pyfunction]
#[pyo3(signature = (path, intrinsics, hfov_deg, topics, clock_offset_ms))]
pub(crate) fn doctor(
    py: Python<'_>,
    path: PathBuf,
    intrinsics: Option<GivenCamera>,
    hfov_deg: Option<f64>,
    topics: Option<&Bound<'_, PyAny>>,
    clock_offset_ms: Option<f64>,
) -> PyResult<String> {
    let opening = Opening::new(intrinsics, hfov_deg, topics, clock_offset_ms)?;
    let diagnosis = abandonable(py, move || diagnosis(&path, &opening))??;
    serde_json::to_string(&diagnosis.record()).map_err(|e| PyValueError::new_err(e.to_string()))
}

fn diagnosis(path: &Path, opening: &Opening) -> Result<Diagnosis, Failure> {
    if is_log(path) {
        if opening.says_something() {
            return Err(Failure {
                message: format!(
                    "{}: a log of speeds by itself has no camera, topics or clock to compare with",
                    path.display()
                ),
                hint: Some("call doctor(path) without further arguments".into()),
            });
        }
        let found = doctor_log(path, &ReadOptions::default());
        return Ok(deepfusion_cli::in_options(found));
    }
    let found = doctor_with(path, &opening.options()?).unwrap_or_else(|error| {
        Diagnosis::unopened(error.to_string(), error.hint()).with_log_within(path)
    });
    Ok(deepfusion_cli::in_options(found))
}
