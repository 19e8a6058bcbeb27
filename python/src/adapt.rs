//! Adapting a network to new drives.

use std::path::{Path, PathBuf};

use deepfusion::data::{Dataset, OpenOptions};
use deepfusion::jobs::devices::ComputeDevice;
use deepfusion::jobs::engine::EngineSettings;
use deepfusion::jobs::recordings::warnings_of;
use deepfusion::jobs::training::adaptation::{AdaptSettings, Adaptation, undo};
use deepfusion::model::Compute;
use deepfusion::runtime::{DepthEstimator, ModelSource};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::device;
use crate::error::{Failure, raise};
use crate::interrupt::interruptible;
use crate::train::{Listener, Warnings, warning_of};

/// The arguments, as `deepfusion/_adapt.py` passes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct AdaptRequest {
    model: PathBuf,
    data_set: Option<String>,
    data: Vec<PathBuf>,
    out: PathBuf,
    camera: String,
    clock_offset_ms: Option<f64>,
    steps: usize,
    batch: usize,
    simulated: usize,
    simulated_camera: String,
    learning_rate: f64,
    held_out: f64,
    speed_error: f64,
    seed: u64,
    device: String,
    /// Changes of the configuration, as `key=value`.
    settings: Vec<String>,
}

impl AdaptRequest {
    fn settings(&self, compute: Compute) -> Result<AdaptSettings, Failure> {
        let camera = self.camera.parse().map_err(|_| Failure {
            message: format!(
                "camera: expected \"2\", \"3\" or \"both\", found {:?}",
                self.camera
            ),
            hint: None,
        })?;
        let own_camera = match self.simulated_camera.as_str() {
            "own" => true,
            "any" => false,
            other => {
                return Err(Failure {
                    message: format!(
                        "simulated_camera: expected \"own\" or \"any\", found {other:?}"
                    ),
                    hint: None,
                });
            }
        };
        Ok(AdaptSettings {
            camera,
            camera_ahead_s: self.clock_offset_ms.map(|ms| ms / 1e3),
            steps: self.steps,
            batch: self.batch,
            simulated: self.simulated,
            own_camera,
            learning_rate: self.learning_rate,
            held_out: self.held_out,
            speed_sd: self.speed_error,
            seed: self.seed,
            set: self.settings.clone(),
            compute,
            ..AdaptSettings::new(self.data.clone(), self.out.clone())
        })
    }
}

/// Trains on new drives, evaluates before and after, and keeps the result or moves it aside. Returns the outcome as JSON.
#[pyfunction]
pub(crate) fn adapt(
    py: Python<'_>,
    asked: Bound<'_, PyDict>,
    callback: Option<Py<PyAny>>,
) -> PyResult<String> {
    let asked: AdaptRequest = asked.extract()?;
    let mut listener = Listener::new(callback);
    deepfusion_cli::keep_memory();
    let outcome = interruptible(py, |stop| -> Result<_, Failure> {
        let judging = &mut |_, _| stop.unwind_if_asked();
        let place = device::named(&asked.device)?;
        let device = device::open(place)?;
        let given = ModelSource::named(&asked.model)?;
        let mut estimator = loaded(&given, asked.data_set.as_deref(), place)?;
        let mut of_recordings = Vec::new();
        let mut opened = |options: &OpenOptions, recordings: &[Dataset]| {
            of_recordings.extend(warnings_of(options, recordings));
        };
        let adaptation = Adaptation::begin(
            given,
            asked.settings(place.compute())?,
            &mut estimator,
            &device,
            &mut opened,
            judging,
        )?;
        let mut warnings = Warnings::default();
        if adaptation.may_have_seen_held_out() {
            warnings.others.push(
                "the given network may have been trained on the frames that are held out here: its metrics may be optimistic".into(),
            );
        }
        let mut of_start = Vec::new();
        let mut trainer = adaptation.trainer(
            &mut opened,
            &mut |warning| warnings.add(warning),
            &mut |start| of_start.extend(warning_of(&start)),
        )?;
        warnings.add_others(of_recordings);
        warnings.others.append(&mut of_start);
        listener.warn(&warnings);
        listener.keep_log(&trainer)?;
        let summary = trainer.run(&mut |event| listener.on_event(event, stop))?;
        drop(trainer);
        if summary.step < summary.steps {
            return Err(Failure {
                message: format!(
                    "stopped after {} of {} {}; the training is saved, but not evaluated",
                    summary.step,
                    summary.steps,
                    if summary.steps == 1 { "step" } else { "steps" }
                ),
                hint: Some("continue with the same call".into()),
            });
        }
        let mut learned = loaded(&ModelSource::named(adaptation.work())?, None, place)?;
        let outcome = adaptation.end(summary.steps, &mut learned, judging)?;
        serde_json::to_string(&outcome).map_err(|error| Failure {
            message: format!("the outcome cannot be written as JSON: {error}"),
            hint: None,
        })
    });
    // The listener's exception is the reason; the training is saved.
    if let Some(raised) = listener.raised {
        return Err(raised);
    }
    Ok(outcome??)
}

/// Loads the network on this device, in f32.
fn loaded(
    network: &ModelSource,
    set: Option<&str>,
    place: ComputeDevice,
) -> Result<DepthEstimator, Failure> {
    let engine = EngineSettings::on(place);
    engine.load(network.load(set)?).map_err(device::failure)
}

/// Makes an adapted network predict as the one that it started from.
#[pyfunction]
pub(crate) fn undo_adaptation(out: PathBuf) -> PyResult<()> {
    undo(Path::new(&out)).map_err(raise)
}
