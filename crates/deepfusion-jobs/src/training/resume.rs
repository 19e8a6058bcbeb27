//! What may be requested of a resumed run, and what contradicts it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion_data::Cameras;
use deepfusion_model::{Error as ModelError, InputSize, Learn, Preset, TrainConfig, ViewMotion};

use super::Start;
use crate::recordings::camera_word;
use crate::{Error, Result};

pub use crate::error::{Contradiction, RequestedValue, RunHas, Setting};

/// The request for a resumed run. The run may be made longer, and its recordings may have moved; everything else must be as in the run, so
/// that no request is silently ignored.
#[derive(Debug, Clone, Default)]
pub struct ResumeRequest {
    /// A configuration file, read over its preset.
    pub file: Option<(PathBuf, Box<TrainConfig>)>,
    /// New paths of the training and validation recordings, and of their splits.
    pub moved: MovedRecordings,
    /// Steps of the whole run.
    pub steps: Option<usize>,
    /// Epochs of the whole run, instead of steps.
    pub epochs: Option<usize>,
    /// A preset.
    pub preset: Option<Preset>,
    /// The size of the network's input.
    pub size: Option<InputSize>,
    /// Number of samples in a batch.
    pub batch: Option<usize>,
    /// The seed.
    pub seed: Option<u64>,
    /// What the network learns from.
    pub learn: Option<Learn>,
    /// The cameras.
    pub camera: Option<Cameras>,
    /// Whether the other camera's view is requested.
    pub stereo: bool,
    /// Whether learning the camera is requested.
    pub learned_camera: bool,
    /// The pose used for warping.
    pub view_motion: Option<ViewMotion>,
    /// Loss terms and parts of the network to switch on.
    pub with: Vec<String>,
    /// Loss terms and parts of the network to switch off.
    pub without: Vec<String>,
    /// Keys with values, such as `batch=4`.
    pub assignments: Vec<String>,
    /// The network that it starts from.
    pub init: Option<PathBuf>,
    /// How far the camera's clock is ahead.
    pub clock: Option<ClockAhead>,
    /// Topics of bags, such as `imu=/imu`.
    pub topics: Vec<String>,
}

/// New paths of recordings.
#[derive(Debug, Clone, Default)]
pub struct MovedRecordings {
    /// Training recordings.
    pub data: Vec<PathBuf>,
    /// Validation recordings.
    pub validation: Vec<PathBuf>,
    /// The split of the training recordings.
    pub split: Option<PathBuf>,
    /// The split of the validation recordings.
    pub validation_split: Option<PathBuf>,
}

/// How far a camera's clock is ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClockAhead {
    /// To be measured. For a resumed run, the value measured at its start is kept.
    Measured,
    /// Given in seconds.
    Seconds(f64),
}

/// A run's configuration with the requested changes.
///
/// # Errors
/// [`Error::Contradiction`]; an unknown term or key.
pub fn resumed_config(run: &TrainConfig, request: &ResumeRequest) -> Result<TrainConfig> {
    // Destructured, so that a new field cannot be forgotten here.
    let ResumeRequest {
        file,
        moved,
        steps,
        epochs,
        preset,
        size,
        batch,
        seed,
        learn,
        camera,
        stereo,
        learned_camera,
        view_motion,
        with,
        without,
        assignments,
        init,
        clock,
        topics,
    } = request;
    let mut config = run.clone();
    config.data.make_absolute();
    if let Some((path, file)) = file {
        take_file(&mut config, path, file, moved)?;
    }
    if let Some(preset) = preset {
        same(Setting::Preset, preset.to_string(), run.preset.to_string())?;
    }
    if let Some(size) = size {
        let text = |size: &InputSize| format!("{}x{}", size.width, size.height);
        same(Setting::Size, text(size), text(&run.size))?;
    }
    if let Some(batch) = batch {
        same(Setting::Batch, batch.to_string(), run.batch.to_string())?;
    }
    if let Some(seed) = seed {
        same(Setting::Seed, seed.to_string(), run.seed.to_string())?;
    }
    if let Some(learn) = learn {
        let found = run.data.learn.name();
        same(Setting::Learn, learn.name().into(), found.into())?;
    }
    if let Some(camera) = camera {
        let found = camera_of(&config);
        same(Setting::Camera, camera_word(*camera).into(), found)?;
    }
    if *stereo && !run.stereo {
        return contradicts(Setting::Stereo, RequestedValue::OtherCamera, RunHas::Off);
    }
    if *learned_camera && run.learned_camera().is_none() {
        let none = RunHas::Value("none".into());
        return contradicts(Setting::LearnedCamera, RequestedValue::Learned, none);
    }
    if let Some(motion) = view_motion {
        let found = run.view_motion.name();
        same(Setting::ViewMotion, motion.name().into(), found.into())?;
    }
    changes_nothing(
        run,
        with,
        Setting::With,
        RunHas::WithoutIt,
        TrainConfig::with,
    )?;
    changes_nothing(
        run,
        without,
        Setting::Without,
        RunHas::WithIt,
        TrainConfig::without,
    )?;
    changes_nothing(
        run,
        assignments,
        Setting::Assignment,
        RunHas::AnotherValue,
        TrainConfig::set,
    )?;
    if let Some(asked) = init {
        same_start(run, asked)?;
    }
    if let Some(clock) = clock {
        same_clock(run, *clock)?;
    }
    for topic in topics {
        if !run.data.topics.contains(topic) {
            let found = match run.data.topics.as_slice() {
                [] => RunHas::NoTopics,
                topics => RunHas::Value(topics.join(", ")),
            };
            return contradicts(Setting::Topic, topic.clone(), found);
        }
    }
    move_recordings(&mut config, moved)?;
    config.steps = steps.or(config.steps);
    if let Some(epochs) = epochs {
        (config.epochs, config.steps, config.min_steps) = (*epochs, None, 0);
    }
    Ok(config)
}

/// Checks that a run is not requested to have fewer steps than it has made. `config` is `run`'s configuration with the request, `steps` its
/// number of steps. If nothing else was requested, fewer steps are not an error: its epochs may have become shorter, and the run is done.
///
/// # Errors
/// [`Error::FewerSteps`].
pub fn require_no_fewer_steps(
    run: &TrainConfig,
    config: &TrainConfig,
    made: usize,
    steps: usize,
) -> Result<()> {
    let is_asked = (config.steps, config.epochs) != (run.steps, run.epochs);
    if is_asked && made > steps {
        let asked = steps;
        return Err(Error::FewerSteps { made, asked });
    }
    Ok(())
}

/// Refuses each of these settings that would change the run.
fn changes_nothing(
    run: &TrainConfig,
    asked: &[String],
    setting: Setting,
    has: RunHas,
    change: impl Fn(&mut TrainConfig, &str) -> std::result::Result<(), ModelError>,
) -> Result<()> {
    for one in asked {
        let mut other = run.clone();
        change(&mut other, one)?;
        if other != *run {
            return contradicts(setting, one.clone(), has);
        }
    }
    Ok(())
}

fn same_start(run: &TrainConfig, asked: &Path) -> Result<()> {
    // `none` and the names of embedded networks are not paths.
    let asked = match (Start::is_none(asked), &run.init_sha256) {
        (true, _) | (false, Some(_)) => asked.to_owned(),
        (false, None) => deepfusion_fs::absolute(asked),
    };
    let found = run.init.as_deref().map_or("none".into(), path_text);
    same(Setting::Init, path_text(&asked), found)
}

fn same_clock(run: &TrainConfig, asked: ClockAhead) -> Result<()> {
    let in_ms = |s: f64| format!("{} ms", 1000.0 * s);
    let found = run.data.camera_ahead_s.map(in_ms);
    match asked {
        ClockAhead::Measured if found.is_some() => Ok(()),
        ClockAhead::Measured => {
            let none = RunHas::Value("none".into());
            contradicts(Setting::Clock, RequestedValue::Measured, none)
        }
        ClockAhead::Seconds(ahead_s) => {
            let found = found.unwrap_or("none".into());
            same(Setting::Clock, in_ms(ahead_s), found)
        }
    }
}

/// Sets new paths of the same recordings.
fn move_recordings(config: &mut TrainConfig, moved: &MovedRecordings) -> Result<()> {
    let MovedRecordings {
        data,
        validation,
        split,
        validation_split,
    } = moved;
    let sets = !config.data.sets.is_empty();
    if !data.is_empty() {
        if sets {
            return contradicts(Setting::Data, list(data), RunHas::OwnOfEachSet);
        }
        config.data.paths.clone_from(data);
    }
    if !validation.is_empty() {
        if sets {
            let asked = list(validation);
            return contradicts(Setting::Validation, asked, RunHas::OwnOfEachSet);
        }
        if config.data.validation.is_empty() {
            return contradicts(Setting::Validation, list(validation), RunHas::HeldOutEnd);
        }
        config.data.validation.clone_from(validation);
    }
    let data = &mut config.data;
    let splits = [
        (Setting::Split, &mut data.split, split),
        (
            Setting::ValidationSplit,
            &mut data.validation_split,
            validation_split,
        ),
    ];
    for (setting, kept, split) in splits {
        let Some(split) = split else { continue };
        if kept.is_none() {
            let found = if sets {
                RunHas::OwnOfEachSet
            } else {
                RunHas::Nothing
            };
            return contradicts(setting, path_text(split), found);
        }
        *kept = Some(split.clone());
    }
    config.data.make_absolute();
    Ok(())
}

/// Takes what a configuration file may change, and checks that everything else in it is as in the run.
fn take_file(
    config: &mut TrainConfig,
    path: &Path,
    file: &TrainConfig,
    moved: &MovedRecordings,
) -> Result<()> {
    (config.steps, config.epochs) = (file.steps, file.epochs);
    config.min_steps = file.min_steps;
    config.checkpoint_minutes = file.checkpoint_minutes;
    // Settings that a run fills in from its data, or that are requested separately, are not compared with the file.
    let mut asked = file.clone();
    asked.data.make_absolute();
    asked.init.clone_from(&config.init);
    asked.init_sha256.clone_from(&config.init_sha256);
    if asked.pose_net.metres_per_unit == 0.0 {
        asked.pose_net.metres_per_unit = config.pose_net.metres_per_unit;
    }
    for (asked, has) in asked.data.sets.iter_mut().zip(&config.data.sets) {
        if asked.metres_per_unit == 0.0 {
            asked.metres_per_unit = has.metres_per_unit;
        }
    }
    let (asked_data, has) = (&mut asked.data, &config.data);
    if !moved.data.is_empty() {
        asked_data.paths.clone_from(&has.paths);
    }
    if !moved.validation.is_empty() {
        asked_data.validation.clone_from(&has.validation);
    }
    if moved.split.is_some() {
        asked_data.split.clone_from(&has.split);
    }
    if moved.validation_split.is_some() {
        asked_data
            .validation_split
            .clone_from(&has.validation_split);
    }
    let mut has = config.clone();
    (asked.data.camera, has.data.camera) = (camera_of(&asked), camera_of(&has));
    let (asked, has) = (settings(&asked)?, settings(&has)?);
    let keys = asked.keys().chain(has.keys());
    for key in keys {
        if asked.get(key) != has.get(key) {
            let of = |settings: &BTreeMap<String, String>| {
                let value = settings.get(key).map_or("nothing", String::as_str);
                format!("{key} = {value}")
            };
            let file = Setting::File(path.to_owned());
            return contradicts(file, of(&asked), RunHas::Value(of(&has)));
        }
    }
    Ok(())
}

/// All settings by their dotted keys.
fn settings(config: &TrainConfig) -> Result<BTreeMap<String, String>> {
    fn add(all: &mut BTreeMap<String, String>, prefix: &str, table: &toml::Table) {
        for (key, value) in table {
            let key = format!("{prefix}{key}");
            match value {
                toml::Value::Table(inner) => add(all, &format!("{key}."), inner),
                value => drop(all.insert(key, value.to_string())),
            }
        }
    }
    let mut all = BTreeMap::new();
    add(&mut all, "", &toml::Table::try_from(config)?);
    Ok(all)
}

/// The cameras that a run learns from; the default is 2.
fn camera_of(config: &TrainConfig) -> String {
    match config.data.camera.as_str() {
        "" => "2".into(),
        camera => camera.into(),
    }
}

fn same(setting: Setting, asked: String, found: String) -> Result<()> {
    if asked == found {
        Ok(())
    } else {
        contradicts(setting, asked, RunHas::Value(found))
    }
}

fn contradicts<T>(setting: Setting, asked: impl Into<RequestedValue>, run: RunHas) -> Result<T> {
    let contradiction = Contradiction::new(setting, asked, run);
    Err(Error::Contradiction(contradiction))
}

fn list(paths: &[PathBuf]) -> String {
    let paths: Vec<String> = paths.iter().map(|p| path_text(p)).collect();
    paths.join(" ")
}

fn path_text(path: &Path) -> String {
    path.display().to_string()
}

/// The setting of a run that names the recording or split which `missing` is, or which contains it; `None` if none does.
#[must_use]
pub fn setting_of(missing: &Path, config: &TrainConfig) -> Option<Setting> {
    let within = |given: &PathBuf| missing.starts_with(given);
    let data = &config.data;
    if data.paths.iter().any(within) {
        Some(Setting::Data)
    } else if data.validation.iter().any(within) {
        Some(Setting::Validation)
    } else if data.split.iter().any(within) {
        Some(Setting::Split)
    } else if data.validation_split.iter().any(within) {
        Some(Setting::ValidationSplit)
    } else if data.sets.iter().any(|set| {
        let all = set.paths.iter().chain(&set.validation);
        let mut all = all.chain(&set.split).chain(&set.validation_split);
        all.any(within)
    }) {
        Some(Setting::DataSet)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_explicit_request_for_fewer_steps_is_refused() {
        let run = Preset::Tiny.config();
        let require = |asked: &TrainConfig, steps| require_no_fewer_steps(&run, asked, 100, steps);
        let mut fewer = run.clone();
        fewer.epochs += 1;
        let error = require(&fewer, 50).unwrap_err().to_string();
        assert!(error.contains("already made 100 steps"), "{error}");
        require(&fewer, 100).unwrap();
        // Images of it may have become unreadable since: the run is done, whatever its epochs are by now.
        require(&run, 50).unwrap();
    }
}
