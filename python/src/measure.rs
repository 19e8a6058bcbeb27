//! Evaluation, simulated drives, and what is wrong with a recording.

use std::path::PathBuf;

use deepfusion::doctor as checks;
use deepfusion::eval::{Crop, Evaluator, Grid, Prediction, Protocol};
use deepfusion::sim::{Scene, SimConfig, Simulation, write_kitti};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::{raise, with_hint};
use crate::interrupt::{Stop, abandonable, interruptible};

/// A name, a prediction and its ground truth.
type Pair<'py> = (
    String,
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray2<'py, f64>,
);

/// The report as JSON, as `deepfusion eval --json` prints it.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    pairs: Vec<Pair<'_>>,
    kind: &str,
    crop: &str,
    cap: f64,
    min_depth: f64,
) -> PyResult<String> {
    let crop = match crop {
        "none" => Crop::None,
        "garg" => Crop::Garg,
        other => return Err(unknown("crop", "\"none\" or \"garg\"", other)),
    };
    let of_kind: fn(Grid) -> Prediction = match kind {
        "depth" => Prediction::Depth,
        "disparity" => Prediction::Disparity,
        other => return Err(unknown("kind", "\"depth\" or \"disparity\"", other)),
    };
    let protocol = Protocol {
        crop,
        cap_m: cap,
        min_m: min_depth,
        ..Protocol::default()
    };
    let mut evaluator = Evaluator::new(protocol).map_err(raise)?;
    for (name, prediction, truth) in &pairs {
        let (prediction, truth) = (of_kind(grid(prediction)?), grid(truth)?);
        let added = py.detach(|| evaluator.add(name, &prediction, &truth).map(|_| ()));
        added.map_err(raise)?;
        py.check_signals()?;
    }
    let report = evaluator.report().map_err(raise)?;
    serde_json::to_string(&report).map_err(|e| PyValueError::new_err(e.to_string()))
}

fn unknown(what: &str, expected: &str, found: &str) -> PyErr {
    PyValueError::new_err(format!("{what}: expected {expected}, found {found:?}"))
}

fn grid(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Grid> {
    let (height, width) = (array.shape()[0], array.shape()[1]);
    let values = array.as_array().iter().copied().collect();
    Grid::new(width, height, values).map_err(raise)
}

/// Writes a simulated drive; gives its folder.
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
            "scene: there is none of this name".into(),
            Some(format!(
                "one of {names}; with varied=True motorway or country, too"
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
pub(crate) fn doctor(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let diagnosis = abandonable(py, move || {
        deepfusion_cli::in_options(checks::doctor(&path, None))
    })?;
    serde_json::to_string(&diagnosis.record()).map_err(|e| PyValueError::new_err(e.to_string()))
}
