//! Training, with a listener in Python.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion::data::{Cameras, Dataset, OpenOptions, Split};
use deepfusion::model::{Compute, DepthNetConfig, Preset, RunFolder, TrainConfig};
use deepfusion::runtime::{ModelSource, embedded_names};
use deepfusion::train::log::{CsvLog, CsvRecord};
use deepfusion::train::{
    Checkpoints, Control, Device, Error, LossTerms, Model, SampleSet, SingleWorker, TrainEvent,
    Trainer, Workers,
};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Failure, raise};
use crate::interrupt::{Stop, interruptible};

/// What was asked for, as `deepfusion/__init__.py` arranges it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct TrainRequest {
    /// A preset's name, or a TOML file.
    config: PathBuf,
    /// `key=value` over it.
    settings: Vec<String>,
    data: Vec<PathBuf>,
    validation: Vec<PathBuf>,
    camera: Option<String>,
    out: PathBuf,
    init: Option<PathBuf>,
    resume: bool,
    workers: Option<PythonWorkers>,
}

/// The other workers, as an object of Python's connects them: `rank`, `count` and `sum(array)`.
#[derive(FromPyObject)]
struct PythonWorkers {
    rank: usize,
    count: usize,
    #[pyo3(attribute)]
    sum: Py<PyAny>,
}

impl PythonWorkers {
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

/// Trains; gives the run's figures as a dict.
#[pyfunction]
pub fn train<'py>(
    py: Python<'py>,
    asked: Bound<'py, PyDict>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let asked: TrainRequest = asked.extract()?;
    let mut listener = Listener::new(callback);
    // As the command does: every operation needs again what the one before freed.
    deepfusion_cli::keep_memory();
    let outcome = interruptible(py, |stop| -> Result<_, Failure> {
        let (mut trainer, skipped) = opened(&asked)?;
        // The first worker's log is of all of them.
        if asked.workers.as_ref().is_none_or(|w| w.rank == 0) {
            let path = trainer.folder().join("log.csv");
            listener.log = Some(CsvLog::open(&path, trainer.step())?);
        }
        let listen = &mut |event| listener.hear(event, stop);
        let summary = trainer.run(listen)?;
        Ok((summary, skipped))
    });
    // What the listener raised is the reason; the run is saved.
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
    figures.set_item("scale_ratio", listener.scale_ratio)?;
    figures.set_item("skipped_drives", skipped)?;
    Ok(figures)
}

/// The trainer that is asked for, and why drives were left out.
fn opened(asked: &TrainRequest) -> Result<(Trainer, Vec<String>), Failure> {
    let device = Device::flex();
    let workers: Box<dyn Workers> = match &asked.workers {
        Some(others) => others.another(),
        None => Box::new(SingleWorker),
    };
    let leads = workers.rank() == 0;
    if asked.resume {
        let folder = RunFolder::open(&asked.out)?.0;
        let mut config = folder.read_settings()?;
        for assignment in &asked.settings {
            config.set(assignment)?;
        }
        choose_data(&mut config, asked)?;
        config.validate()?;
        let (train, validation, skipped) = samples(&config)?;
        if leads {
            folder.write_config(&config, &folder.read_findings()?)?;
        }
        let sets = (train, validation);
        let trainer = Trainer::resume_among(workers, config, folder, sets, &device)?;
        return Ok((trainer, skipped));
    }
    let mut config = configuration(asked)?;
    let start = Start::of(asked, &config)?;
    start.record_in(&mut config)?;
    config.validate()?;
    let (train, validation, skipped) = samples(&config)?;
    let folder = if leads {
        RunFolder::create(&asked.out)?
    } else {
        RunFolder::of_another(&asked.out)
    };
    let sets = (train, validation);
    let trainer = Trainer::create_among(workers, config, folder, sets, &device, |model| {
        start.initialise(model, &device)
    })?;
    Ok((trainer, skipped))
}

fn configuration(asked: &TrainRequest) -> Result<TrainConfig, Failure> {
    let preset = Preset::ALL
        .into_iter()
        .find(|preset| Path::new(preset.name()) == asked.config);
    let mut config = match preset {
        Some(preset) => preset.config_on(Compute::Processor),
        None if asked.config.extension().is_none() && !asked.config.exists() => {
            let names: Vec<&str> = Preset::ALL.iter().map(|preset| preset.name()).collect();
            return Err(Failure {
                message: format!("config: no preset `{}`", asked.config.display()),
                hint: Some(format!(
                    "a preset ({}), the path of a TOML file, or a dict",
                    names.join(", ")
                )),
            });
        }
        None => TrainConfig::read_over_preset(&asked.config, Compute::Processor)?,
    };
    for assignment in &asked.settings {
        config.set(assignment)?;
    }
    choose_data(&mut config, asked)?;
    if config.data.paths.is_empty() && config.data.sets.is_empty() {
        return Err(Failure {
            message: "data: nothing to learn from".into(),
            hint: Some("train(config, data): a recording's path or several; or data.paths in the configuration".into()),
        });
    }
    Ok(config)
}

/// The recordings that are given, in place of the configuration's own.
fn choose_data(config: &mut TrainConfig, asked: &TrainRequest) -> Result<(), Failure> {
    let given = !asked.data.is_empty() || !asked.validation.is_empty();
    if given && !config.data.sets.is_empty() {
        return Err(Failure {
            message: "data: the configuration has data.sets of its own".into(),
            hint: Some(
                "leave data and validation out, or take data.sets out of the configuration".into(),
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

/// Samples to learn from and to validate on, and why drives were left out.
fn samples(config: &TrainConfig) -> Result<(SampleSet, SampleSet, Vec<String>), Failure> {
    let (mut train, mut validation) = (Vec::new(), Vec::new());
    let data = &config.data;
    if data.sets.is_empty() {
        let (clock, topics) = (data.camera_ahead_s, &data.topics);
        let open =
            |paths: &[PathBuf], split| recordings(paths, split, &data.camera, (clock, topics), 0);
        train = open(&data.paths, data.split.as_deref())?;
        if !data.validation.is_empty() || data.validation_split.is_some() {
            let own = own_or(&data.validation, &data.paths);
            validation = open(own, data.validation_split.as_deref())?;
        }
    }
    for (i, set) in data.sets.iter().enumerate() {
        let camera = match set.camera.as_str() {
            "" => &data.camera,
            own => own,
        };
        let clock = set.camera_ahead_s.or(data.camera_ahead_s);
        let topics = match set.topics.as_slice() {
            [] => &data.topics,
            own => own,
        };
        let open = |paths: &[PathBuf], split| recordings(paths, split, camera, (clock, topics), i);
        train.extend(open(&set.paths, set.split.as_deref())?);
        if set.validates() {
            let own = own_or(&set.validation, &set.paths);
            validation.extend(open(own, set.validation_split.as_deref())?);
        }
    }
    let validation = (!validation.is_empty()).then_some(validation);
    Ok(SampleSet::split_sets(config, train, validation)?)
}

/// Without recordings of its own, validation takes frames of those that are learned from.
fn own_or<'a>(own: &'a [PathBuf], others: &'a [PathBuf]) -> &'a [PathBuf] {
    match own.is_empty() {
        true => others,
        false => own,
    }
}

fn recordings(
    paths: &[PathBuf],
    split: Option<&Path>,
    camera: &str,
    (camera_ahead_s, topics): (Option<f64>, &[String]),
    set: usize,
) -> Result<Vec<(usize, Dataset)>, Failure> {
    let camera: Result<Cameras, Failure> = match camera {
        "" => Ok(Cameras::default()),
        text => text.parse().map_err(|_| Failure {
            message: format!("camera: `{text}`"),
            hint: Some("\"2\", \"3\" or \"both\"".into()),
        }),
    };
    let topics = topics.iter().map(|text| {
        text.parse().map_err(|hint| Failure {
            message: format!("topics: `{text}`"),
            hint: Some(hint),
        })
    });
    let options = OpenOptions {
        camera: camera?,
        split: split.map(Split::read).transpose()?,
        camera_ahead_s,
        topics: topics.collect::<Result<_, Failure>>()?,
        ..OpenOptions::default()
    };
    let mut all = Vec::new();
    for path in paths {
        let opened = Dataset::open(path, &options)?;
        all.extend(opened.into_iter().map(|dataset| (set, dataset)));
    }
    Ok(all)
}

/// What a new run's networks begin from.
enum Start {
    /// The weights of the seed.
    Nothing,
    /// A trained network.
    Network(ModelSource),
}

impl Start {
    /// What is asked for, else what the configuration says, else for a preset the embedded network with the same layers: as the command.
    fn of(asked: &TrainRequest, config: &TrainConfig) -> Result<Self, Failure> {
        if let Some(init) = asked.init.as_ref().or(config.init.as_ref()) {
            if init == Path::new("none") {
                return Ok(Self::Nothing);
            }
            return Ok(Self::Network(ModelSource::named(init)?));
        }
        if Preset::ALL
            .iter()
            .all(|preset| Path::new(preset.name()) != asked.config)
        {
            return Ok(Self::Nothing);
        }
        for name in embedded_names() {
            let source = ModelSource::named(Path::new(name))?;
            let theirs = source.load(None)?.config;
            if same_layers(&theirs.depth_net, &config.depth_net) {
                return Ok(Self::Network(source));
            }
        }
        Ok(Self::Nothing)
    }

    /// So that the run can be repeated; and takes what the weights' metres stand on.
    fn record_in(&self, config: &mut TrainConfig) -> Result<(), Failure> {
        let Self::Network(source) = self else {
            (config.init, config.init_sha256) = (None, None);
            return Ok(());
        };
        let given = source.given();
        let embedded = embedded_names().iter().any(|name| Path::new(name) == given);
        let sha256 = source
            .packed_sha256()
            .filter(|_| embedded && !given.exists());
        if let (Some(expected), Some(found)) = (&config.init_sha256, sha256)
            && expected != found
            && config.init.as_deref() == Some(given)
        {
            return Err(Failure {
                message: format!(
                    "the run began from other weights of the name `{}` than are embedded here",
                    given.display()
                ),
                hint: Some("init=\"none\", or the path of the weights that are meant".into()),
            });
        }
        config.init_sha256 = sha256.map(Into::into);
        config.init = Some(given.to_owned());
        let theirs = match source {
            ModelSource::Run { folder, .. } => folder.read_config()?,
            ModelSource::Packed { .. } => source.load(None)?.config,
        };
        config.canonical_focal_px = config.canonical_focal_px.or(theirs.canonical_focal_px);
        if let ModelSource::Run { folder, kind, .. } = source
            && config.pose_net.metres_per_unit == 0.0
            && !folder.read_state(*kind)?.encoders_only
        {
            // Its PoseNet speaks of this unit.
            config.pose_net.metres_per_unit = theirs.pose_net.metres_per_unit;
        }
        Ok(())
    }

    fn initialise(&self, mut model: Model, device: &Device) -> Result<Model, Error> {
        match self {
            Self::Nothing => Ok(model),
            Self::Network(ModelSource::Run { folder, kind, .. }) => {
                let device = device.clone().autodiff();
                Ok(folder.load_networks(*kind, model.config(), &device)?.0)
            }
            Self::Network(source) => {
                let weights = source.load(None)?.weights;
                model.depth_net = model.depth_net.with_weights(&weights)?.0;
                Ok(model)
            }
        }
    }
}

/// Whether one network's weights are the other's and mean the same depths: all but the depth that a new one starts at, whether its
/// batch norms learn, and the head for uncertainty.
fn same_layers(a: &DepthNetConfig, b: &DepthNetConfig) -> bool {
    let bare = |config: &DepthNetConfig| {
        let mut config = config.clone();
        config.initial_depth_m = None;
        config.encoder.frozen_statistics = false;
        config.uncertainty = false;
        config
    };
    bare(a) == bare(b)
}

/// Hears the trainer's events, logs them as the command does, and calls Python.
struct Listener {
    callback: Option<Py<PyAny>>,
    log: Option<CsvLog>,
    /// What went wrong in it: training stops, and this is raised.
    raised: Option<PyErr>,
    losses: Option<LossTerms>,
    validation: Option<LossTerms>,
    scale_ratio: Option<f64>,
}

impl Listener {
    fn new(callback: Option<Py<PyAny>>) -> Self {
        Self {
            callback,
            log: None,
            raised: None,
            losses: None,
            validation: None,
            scale_ratio: None,
        }
    }

    fn hear(&mut self, event: TrainEvent, stop: &Stop) -> Control {
        match self.handle(event) {
            Ok(true) if !stop.asked() => Control::Continue,
            Ok(_) => Control::Stop,
            Err(error) => {
                self.raised.get_or_insert(error);
                Control::Stop
            }
        }
    }

    /// Whether to go on.
    fn handle(&mut self, event: TrainEvent) -> PyResult<bool> {
        self.record(&event).map_err(raise)?;
        let Some(callback) = &self.callback else {
            return Ok(true);
        };
        Python::attach(|py| {
            let answer = callback.call1(py, (as_dict(py, event)?,))?;
            // None is no answer: only False ends it.
            Ok(!matches!(answer.extract::<bool>(py), Ok(false)))
        })
    }

    fn record(&mut self, event: &TrainEvent) -> Result<(), Error> {
        let record = match event {
            TrainEvent::Step {
                step,
                losses,
                learning_rate,
                images_per_second,
                scale_ratio,
                ..
            } => {
                self.losses = Some(*losses);
                self.scale_ratio = Some(*scale_ratio);
                CsvRecord {
                    step: *step,
                    losses,
                    learning_rate: *learning_rate,
                    scale_ratio: *scale_ratio,
                    images_per_second: *images_per_second,
                    selection: None,
                }
            }
            TrainEvent::Validated {
                step,
                losses,
                selection,
                scale_ratio,
                ..
            } => {
                self.validation = Some(*losses);
                CsvRecord {
                    step: *step,
                    losses,
                    learning_rate: 0.0,
                    scale_ratio: *scale_ratio,
                    images_per_second: 0.0,
                    selection: Some(*selection),
                }
            }
            _ => return Ok(()),
        };
        match &mut self.log {
            Some(log) => log.write(&record),
            None => Ok(()),
        }
    }
}

fn terms(losses: LossTerms) -> BTreeMap<&'static str, f64> {
    losses.named().into_iter().collect()
}

/// An event as a dict; `event` says which.
fn as_dict(py: Python<'_>, event: TrainEvent) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let name = match event {
        TrainEvent::Started {
            from_step,
            steps,
            samples,
            validation_samples,
            mean_displacement_m,
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
        TrainEvent::Warning { step, message } => {
            dict.set_item("step", step)?;
            dict.set_item("message", message)?;
            "warning"
        }
    };
    dict.set_item("event", name)?;
    Ok(dict)
}
