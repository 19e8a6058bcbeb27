//! Training, with a listener in Python.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion::jobs::recordings::warnings_of;
use deepfusion::jobs::samples::{SampleWarning, open_samples};
use deepfusion::jobs::training::resume::{
    MovedRecordings, ResumeRequest, require_no_fewer_steps, resumed_config,
};
use deepfusion::jobs::training::{RunLock, RunLog, Start, StartReport};
use deepfusion::model::{CheckpointKind, Compute, Preset, RunFolder, TrainConfig};
use deepfusion::train::{
    Control, LossTerms, SampleSet, SingleWorker, TrainEvent, Trainer, Workers,
};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::device;
use crate::error::{Failure, raise, warn};
use crate::interrupt::{Stop, interruptible};

/// The arguments, as `deepfusion/_train.py` passes them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct TrainRequest {
    /// A preset's name or a TOML file; without it, the default or the configuration of the resumed run.
    config: Option<PathBuf>,
    /// Changes of the configuration, as `key=value`.
    settings: Vec<String>,
    data: Vec<PathBuf>,
    validation: Vec<PathBuf>,
    camera: Option<String>,
    out: PathBuf,
    init: Option<PathBuf>,
    resume: bool,
    workers: Option<PythonWorkers>,
    device: String,
}

/// The connection to the other workers, a Python object with `rank`, `count` and `sum(array)`.
#[derive(FromPyObject)]
struct PythonWorkers {
    rank: usize,
    count: usize,
    #[pyo3(attribute)]
    sum: Py<PyAny>,
}

impl PythonWorkers {
    /// Fails if another worker could not start: waiting for its gradients would last forever. A worker that could not start itself fails with
    /// its own error.
    fn all_begun(&self, own: bool) -> Result<(), Failure> {
        let mut failed = [if own { 0.0 } else { 1.0 }];
        let summed = self.another().sum(&mut failed);
        match summed {
            Ok(()) if own && failed[0] > 0.0 => Err(Failure {
                message: format!(
                    "worker {} of {}: another worker could not start",
                    self.rank, self.count
                ),
                hint: Some("see that worker's error".into()),
            }),
            Err(error) if own => Err(Failure {
                message: format!("worker {} of {}: {error}", self.rank, self.count),
                hint: None,
            }),
            _ => Ok(()),
        }
    }

    fn another(&self) -> Box<dyn Workers> {
        Box::new(Self {
            rank: self.rank,
            count: self.count,
            sum: Python::attach(|py| self.sum.clone_ref(py)),
        })
    }
}

impl Workers for PythonWorkers {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        Python::attach(|py| {
            let array = PyArray1::from_slice(py, values);
            self.sum.call1(py, (&array,))?;
            values.copy_from_slice(array.try_readonly()?.as_slice()?);
            Ok(())
        })
    }
}

/// Trains and returns the run's results as a dict.
#[pyfunction]
pub(crate) fn train<'py>(
    py: Python<'py>,
    asked: Bound<'py, PyDict>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let asked: TrainRequest = asked.extract()?;
    let mut listener = Listener::new(callback);
    // As in the command: each operation needs the memory that the previous one freed.
    deepfusion_cli::keep_memory();
    let outcome = interruptible(py, |stop| -> Result<_, Failure> {
        let mut warnings = Warnings::default();
        let begun = begin(&asked, &mut warnings, &mut listener);
        if let Some(workers) = &asked.workers {
            workers.all_begun(begun.is_ok())?;
        }
        let (mut trainer, _lock) = begun?;
        let listen = &mut |event| listener.on_event(event, stop);
        let summary = trainer.run(listen)?;
        Ok((summary, warnings.skipped))
    });
    // The listener's exception is the reason; the run is saved.
    if let Some(raised) = listener.raised {
        return Err(raised);
    }
    let (summary, skipped) = outcome??;
    let figures = PyDict::new(py);
    figures.set_item("path", asked.out)?;
    figures.set_item("step", summary.step)?;
    figures.set_item("steps", summary.steps)?;
    figures.set_item("skipped_steps", summary.skipped)?;
    figures.set_item("best_validation", summary.best_validation)?;
    figures.set_item("seconds", summary.seconds)?;
    figures.set_item("stopped", summary.stopped)?;
    figures.set_item("losses", listener.losses.map(terms))?;
    figures.set_item("validation", listener.validation.map(terms))?;
    let scale_ratio = listener.scale_ratio.filter(|ratio| ratio.is_finite());
    figures.set_item("scale_ratio", scale_ratio)?;
    figures.set_item("skipped_drives", skipped)?;
    Ok(figures)
}

/// The requested trainer; issues its warnings and opens its log.
fn begin(
    asked: &TrainRequest,
    warnings: &mut Warnings,
    listener: &mut Listener,
) -> Result<(Trainer, Option<RunLock>), Failure> {
    let (trainer, lock) = opened(asked, warnings)?;
    listener.warn(warnings);
    // Only the first worker logs.
    if asked.workers.as_ref().is_none_or(|w| w.rank == 0) {
        listener.keep_log(&trainer)?;
    }
    Ok((trainer, lock))
}

/// Warnings about the recordings.
#[derive(Default)]
pub(crate) struct Warnings {
    /// Why drives were left out.
    pub skipped: Vec<String>,
    pub others: Vec<String>,
}

impl Warnings {
    pub(crate) fn add(&mut self, warning: SampleWarning) {
        match warning {
            SampleWarning::Skipped(reason) => self.skipped.push(reason.to_string()),
            other => self.others.push(other.to_string()),
        }
    }

    /// Adds each warning once: a recording may be opened both for training and for validation.
    pub(crate) fn add_others(&mut self, warnings: Vec<String>) {
        for warning in warnings {
            if !self.others.contains(&warning) {
                self.others.push(warning);
            }
        }
    }
}

/// The samples of a configuration; adds warnings about them and their recordings.
fn samples(
    config: &TrainConfig,
    warnings: &mut Warnings,
) -> Result<(SampleSet, SampleSet), Failure> {
    let mut of_recordings = Vec::new();
    let sets = open_samples(
        config,
        &mut |options, recordings| of_recordings.extend(warnings_of(options, recordings)),
        &mut |warning| warnings.add(warning),
    )?;
    warnings.add_others(of_recordings);
    Ok(sets)
}

/// The warning about the weights to start from, if any.
pub(crate) fn warning_of(start: &StartReport) -> Option<String> {
    match start {
        StartReport::OtherMeaning(warning) => Some(warning.to_string()),
        _ => None,
    }
}

/// The requested trainer and, for the first worker, the lock of the run's folder.
fn opened(
    asked: &TrainRequest,
    warnings: &mut Warnings,
) -> Result<(Trainer, Option<RunLock>), Failure> {
    let place = device::named(&asked.device)?;
    let device = device::open(place)?;
    let workers: Box<dyn Workers> = match &asked.workers {
        Some(others) => others.another(),
        None => Box::new(SingleWorker),
    };
    let leads = workers.rank() == 0;
    if asked.resume {
        let folder = RunFolder::open(&asked.out)?.0;
        let lock = lock_of(&folder, leads)?;
        let run = folder.read_settings()?;
        let config = resumed_config(&run, &asked.to_resume(place.compute())?)?;
        config.validate()?;
        // The run's errors are reported before the recordings are opened, which may take long.
        folder.require_checkpoint(CheckpointKind::Last)?;
        if let Some(steps) = config.steps {
            let made = folder.read_state(CheckpointKind::Last)?.step;
            require_no_fewer_steps(&run, &config, made, steps)?;
        }
        let sets = samples(&config, warnings)?;
        let settings = config.clone();
        let trainer = Trainer::resume_among(workers, config, folder.clone(), sets, &device)?;
        // The number of steps of the epochs is known only now.
        require_no_fewer_steps(&run, &settings, trainer.step(), trainer.steps())?;
        // Written only now, since settings with which the run cannot continue are refused above.
        if leads {
            folder.write_config(&settings, &folder.read_findings()?)?;
        }
        return Ok((trainer, lock));
    }
    if leads && is_occupied(&asked.out) {
        return Err(Failure {
            message: format!("{}: is not empty", asked.out.display()),
            hint: Some(
                "choose another folder, empty this one first, or continue the run in it (resume=True)".into(),
            ),
        });
    }
    let (mut config, is_preset) = configuration(asked, place.compute())?;
    let start = Start::of(asked.init.as_deref(), &config, is_preset)?;
    start.record_in(&mut config)?;
    config.validate()?;
    let sets = samples(&config, warnings)?;
    let folder = if leads {
        RunFolder::create(&asked.out)?
    } else {
        RunFolder::of_another(&asked.out)
    };
    let lock = lock_of(&folder, leads)?;
    let trainer = Trainer::create_among(workers, config, folder, sets, &device, |model| {
        start.initialise(model, &device, &mut |start| {
            warnings.others.extend(warning_of(&start));
        })
    })?;
    Ok((trainer, lock))
}

/// The lock of a run's folder, for the worker that writes there.
fn lock_of(folder: &RunFolder, leads: bool) -> Result<Option<RunLock>, Failure> {
    Ok(if leads {
        Some(RunLock::take(folder.path())?)
    } else {
        None
    })
}

/// Whether a path exists and is not an empty folder.
fn is_occupied(path: &Path) -> bool {
    match std::fs::read_dir(path) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) => path.exists(),
    }
}

impl TrainRequest {
    /// The request to resume a run, by the command's rules: it may be made longer, and its recordings may have moved.
    fn to_resume(&self, compute: Compute) -> Result<ResumeRequest, Failure> {
        let mut request = ResumeRequest {
            moved: MovedRecordings {
                data: self.data.clone(),
                validation: self.validation.clone(),
                ..MovedRecordings::default()
            },
            init: self.init.clone(),
            ..ResumeRequest::default()
        };
        if let Some(config) = &self.config {
            request.preset = preset_named(config);
            if request.preset.is_none() {
                let file = TrainConfig::read_over_preset(config, compute)?;
                request.file = Some((config.clone(), Box::new(file)));
            }
        }
        if let Some(camera) = &self.camera {
            request.assignments.push(format!("data.camera={camera:?}"));
        }
        for assignment in &self.settings {
            let (key, value) = assignment.split_once('=').unwrap_or((assignment, ""));
            match (key, value.parse()) {
                ("steps", Ok(steps)) => request.steps = Some(steps),
                ("epochs", Ok(epochs)) => request.epochs = Some(epochs),
                _ => request.assignments.push(assignment.clone()),
            }
        }
        Ok(request)
    }
}

/// The preset of this name.
fn preset_named(name: &Path) -> Option<Preset> {
    let mut all = Preset::ALL.into_iter();
    all.find(|preset| Path::new(preset.name()) == name)
}

/// The requested configuration, and whether it is a preset's, which does not state what the run starts from. A preset's sizes depend on the
/// device.
fn configuration(asked: &TrainRequest, compute: Compute) -> Result<(TrainConfig, bool), Failure> {
    let given = asked.config.as_deref();
    let given = given.unwrap_or(Path::new(Preset::Tiny.name()));
    let preset = preset_named(given);
    let mut config = match preset {
        Some(preset) => preset.config_on(compute),
        None if given.extension().is_none() && !given.exists() => {
            let names: Vec<&str> = Preset::ALL.iter().map(|preset| preset.name()).collect();
            return Err(Failure {
                message: format!("config: no preset `{}`", given.display()),
                hint: Some(format!(
                    "give a preset ({}), the path of a TOML file, or a dict",
                    names.join(", ")
                )),
            });
        }
        None => TrainConfig::read_over_preset(given, compute)?,
    };
    for assignment in &asked.settings {
        config.set(assignment)?;
    }
    choose_data(&mut config, asked)?;
    if config.data.paths.is_empty() && config.data.sets.is_empty() {
        return Err(Failure {
            message: "data: no recordings to train on".into(),
            hint: Some("give one or more paths of recordings, as train(config, data) or as data.paths in the configuration".into()),
        });
    }
    Ok((config, preset.is_some()))
}

/// Replaces the configuration's recordings by those that are given.
fn choose_data(config: &mut TrainConfig, asked: &TrainRequest) -> Result<(), Failure> {
    let given = !asked.data.is_empty() || !asked.validation.is_empty();
    if given && !config.data.sets.is_empty() {
        return Err(Failure {
            message: "data: not allowed beside data.sets in the configuration".into(),
            hint: Some(
                "leave out data and validation, or remove data.sets from the configuration".into(),
            ),
        });
    }
    if !asked.data.is_empty() {
        config.data.paths.clone_from(&asked.data);
    }
    if !asked.validation.is_empty() {
        config.data.validation.clone_from(&asked.validation);
    }
    if let Some(camera) = &asked.camera {
        config.data.camera.clone_from(camera);
    }
    if config.data.camera.is_empty() && config.data.sets.is_empty() {
        config.data.camera = "2".into();
    }
    Ok(())
}

/// Receives the trainer's events, logs them as the command does, and calls Python.
pub(crate) struct Listener {
    callback: Option<Py<PyAny>>,
    log: Option<RunLog>,
    /// The exception of the callback: training stops, and it is raised.
    pub raised: Option<PyErr>,
    /// Whether the callback returned False for any event: training stops at the next chance.
    ends: bool,
    losses: Option<LossTerms>,
    validation: Option<LossTerms>,
    scale_ratio: Option<f64>,
}

impl Listener {
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> Self {
        Self {
            callback,
            log: None,
            raised: None,
            ends: false,
            losses: None,
            validation: None,
            scale_ratio: None,
        }
    }

    /// Writes the run's files from now on.
    pub(crate) fn keep_log(&mut self, trainer: &Trainer) -> Result<(), Failure> {
        self.log = Some(RunLog::open(trainer.folder(), trainer.step())?);
        Ok(())
    }

    /// Issues Python warnings; if those are errors, the first stops the run.
    pub(crate) fn warn(&mut self, warnings: &Warnings) {
        for text in &warnings.others {
            let warned = Python::attach(|py| warn(py, text));
            if let Err(error) = warned {
                self.raised.get_or_insert(error);
            }
        }
    }

    pub(crate) fn on_event(&mut self, event: TrainEvent, stop: &Stop) -> Control {
        match self.handle(event) {
            Ok(continues) => {
                self.ends |= !continues;
                if self.ends || stop.asked() || self.raised.is_some() {
                    Control::Stop
                } else {
                    Control::Continue
                }
            }
            Err(error) => {
                self.raised.get_or_insert(error);
                Control::Stop
            }
        }
    }

    /// Handles an event and returns whether to continue.
    fn handle(&mut self, event: TrainEvent) -> PyResult<bool> {
        self.record(&event)?;
        let Some(callback) = &self.callback else {
            return Ok(true);
        };
        Python::attach(|py| {
            let answer = callback.call1(py, (as_dict(py, event)?,))?;
            // Only False stops the training, None does not.
            Ok(!matches!(answer.extract::<bool>(py), Ok(false)))
        })
    }

    /// Keeps an event's results and writes it to the run's log.
    fn record(&mut self, event: &TrainEvent) -> PyResult<()> {
        match event {
            TrainEvent::Step {
                losses,
                scale_ratio,
                ..
            } => (self.losses, self.scale_ratio) = (Some(*losses), Some(*scale_ratio)),
            TrainEvent::Validated { losses, .. } => self.validation = Some(*losses),
            _ => {}
        }
        match &mut self.log {
            Some(log) => log.write(event).map_err(raise),
            None => Ok(()),
        }
    }
}

fn terms(losses: LossTerms) -> BTreeMap<&'static str, f64> {
    losses.named().into_iter().collect()
}

/// An event as a dict; its key `event` is the kind.
fn as_dict(py: Python<'_>, event: TrainEvent) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let name = match event {
        TrainEvent::Started {
            from_step,
            steps,
            samples,
            validation_samples,
            mean_displacement_m,
            ..
        } => {
            dict.set_item("from_step", from_step)?;
            dict.set_item("steps", steps)?;
            dict.set_item("samples", samples)?;
            dict.set_item("validation_samples", validation_samples)?;
            dict.set_item("mean_displacement_m", mean_displacement_m)?;
            "started"
        }
        TrainEvent::Step {
            step,
            steps,
            losses,
            learning_rate,
            images_per_second,
            remaining_s,
            scale_ratio,
            gradient_norm,
        } => {
            dict.set_item("step", step)?;
            dict.set_item("steps", steps)?;
            dict.set_item("losses", terms(losses))?;
            dict.set_item("learning_rate", learning_rate)?;
            dict.set_item("images_per_second", images_per_second)?;
            dict.set_item("remaining_s", remaining_s)?;
            dict.set_item("scale_ratio", scale_ratio)?;
            dict.set_item("gradient_norm", gradient_norm)?;
            "step"
        }
        TrainEvent::Validated {
            step,
            losses,
            selection,
            scale_ratio,
            best,
        } => {
            dict.set_item("step", step)?;
            dict.set_item("losses", terms(losses))?;
            dict.set_item("selection", selection)?;
            dict.set_item("scale_ratio", scale_ratio)?;
            dict.set_item("best", best)?;
            "validated"
        }
        TrainEvent::Panel { step, panel } => {
            let wrong = |e: numpy::ndarray::ShapeError| PyValueError::new_err(e.to_string());
            let (height, width) = (panel.height, panel.width);
            let image = Array3::from_shape_vec((3, height, width), panel.image).map_err(wrong)?;
            let disparity =
                Array2::from_shape_vec((height, width), panel.disparity).map_err(wrong)?;
            dict.set_item("step", step)?;
            dict.set_item("name", panel.name)?;
            dict.set_item("image", image.into_pyarray(py))?;
            dict.set_item("disparity", disparity.into_pyarray(py))?;
            "panel"
        }
        TrainEvent::Camera { camera, learned } => {
            dict.set_item("step", learned.step)?;
            dict.set_item("size", (camera.width, camera.height))?;
            dict.set_item("focal_px", learned.focal_px)?;
            dict.set_item("sigma_px", learned.sigma_px)?;
            "camera"
        }
        TrainEvent::Saved { step, path } => {
            dict.set_item("step", step)?;
            dict.set_item("path", path)?;
            "saved"
        }
        TrainEvent::Warning { step, warning } => {
            dict.set_item("step", step)?;
            dict.set_item("message", warning.to_string())?;
            "warning"
        }
    };
    dict.set_item("event", name)?;
    Ok(dict)
}
