use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::Result;
use deepfusion_data::{Camera, CameraChoice, Dataset, OpenOptions, speed_unit_warning};
use deepfusion_nn::weights::load_torchvision_resnet;
use deepfusion_train::{
    CheckpointKind, DataConfig, DataSetConfig, Error, Model, Preset, RunFolder, SampleSet,
    TrainConfig, Trainer, ViewMotion, shared_frames,
};

use super::device;
use super::evaluate::{open_quietly, open_recordings, read_split};
use super::recorder::{Recorder, clock};
use super::remarks;
use crate::allocator;
use crate::cli::{PresetChoice, TrainArgs, ViewMotionChoice};
use crate::progress::say;
use crate::{interrupt, output};

/// `deepfusion train`.
pub fn run(args: &TrainArgs) -> Result<()> {
    let device = device::open(args.device)?;
    let resumed = match (&args.out, args.resume) {
        (Some(out), true) => Some(RunFolder::open(out)?.0),
        _ => None,
    };
    let mut config = match &resumed {
        Some(folder) => folder.read_config()?,
        None => start_config(args)?,
    };
    // A resumed run may be made longer; all else is as it was.
    config.steps = args.steps.or(config.steps);
    if let Some(epochs) = args.epochs {
        (config.epochs, config.steps) = (epochs, None);
    }
    if !args.data.is_empty() {
        // A resumed run's sets have factors that new recordings would not have: `validate` refuses both.
        config.data.paths.clone_from(&args.data);
    }
    config.validate()?;
    let sets = open_samples(&config)?;
    let mut trainer = match resumed {
        Some(folder) => {
            folder.write_config(&config)?;
            Trainer::resume(config, folder, sets, &device)?
        }
        None => {
            let folder = output::run_folder(args.out.as_deref(), "train")?;
            let folder = RunFolder::create(&folder)?;
            let init = args.init.as_deref();
            if let Some(folder) = init.map(run_of).transpose()?.flatten()
                && config.pose_net.metres_per_unit == 0.0
            {
                // Its PoseNet speaks of this unit.
                config.pose_net.metres_per_unit = folder.0.read_config()?.pose_net.metres_per_unit;
            }
            let settings = config.clone();
            Trainer::create(config, folder, sets, &device, |model| match init {
                Some(path) => initialise(model, path, &settings, &device),
                None => Ok(model),
            })?
        }
    };
    train(&mut trainer)?;
    output::print(&format!("{}\n", trainer.folder().display()))
}

/// Runs a trainer with its logs.
pub fn train(trainer: &mut Trainer) -> Result<()> {
    allocator::keep_memory();
    interrupt::catch("stopping after this step; the run is saved");
    let mut recorder = Recorder::open(trainer.folder(), trainer.step())?;
    let summary = trainer.run(&mut |event| recorder.handle(event))?;
    recorder.finish()?;
    say(&format!(
        "{} {} of {} steps in {}{}",
        if summary.stopped {
            "stopped after"
        } else {
            "done:"
        },
        summary.step,
        summary.steps,
        clock(summary.seconds),
        if summary.skipped > 0 {
            format!(
                ", {} skipped for a gradient that was not finite",
                summary.skipped
            )
        } else {
            String::new()
        }
    ));
    Ok(())
}

fn start_config(args: &TrainArgs) -> Result<TrainConfig> {
    let mut config = match &args.config {
        Some(path) => TrainConfig::read(path)?,
        None => preset(args.preset.unwrap_or(PresetChoice::Tiny)).config(),
    };
    if let Some(size) = args.size {
        config.size.width = size.width as usize;
        config.size.height = size.height as usize;
    }
    config.batch = args.batch.unwrap_or(config.batch);
    config.seed = args.seed.unwrap_or(config.seed);
    for term in &args.with {
        config.with(term)?;
    }
    for term in &args.without {
        config.without(term)?;
    }
    // Said last: a motion that contradicts a term left out is an error, and not silently another one.
    if let Some(choice) = args.view_motion {
        config.view_motion = match choice {
            ViewMotionChoice::Posenet => ViewMotion::PoseNet,
            ViewMotionChoice::Distance => ViewMotion::Distance,
            ViewMotionChoice::Vehicle => ViewMotion::Vehicle,
        };
    }
    if args.data.is_empty() {
        // The file's own recordings, of which at least one is needed.
        if config.data.paths.is_empty() && config.data.sets.is_empty() {
            return Err(Error::Config {
                field: "data",
                expected: "--data, or data.paths or [[data.sets]] in the config file".into(),
                found: "none".into(),
            }
            .into());
        }
        return Ok(config);
    }
    config.data = DataConfig {
        paths: args.data.clone(),
        validation: args.val_data.clone(),
        split: args.split.clone(),
        validation_split: args.val_split.clone(),
        camera_ahead_s: args.camera_ahead_s,
        camera: match args.camera.cameras() {
            [Camera::Left] => "2",
            [Camera::Right] => "3",
            _ => "both",
        }
        .into(),
        sets: Vec::new(),
    };
    Ok(config)
}

/// The preset of a name on the command line.
pub fn preset(choice: PresetChoice) -> Preset {
    match choice {
        PresetChoice::Tiny => Preset::Tiny,
        PresetChoice::Light => Preset::Light,
        PresetChoice::Resnet50 => Preset::Resnet50,
        PresetChoice::Paper => Preset::Paper,
        PresetChoice::Monodepth2 => Preset::Monodepth2,
    }
}

/// The training and validation samples of a configuration; warns of drives that are skipped and of
/// speeds that cannot be m/s.
pub fn open_samples(config: &TrainConfig) -> Result<(SampleSet, SampleSet)> {
    let train = open_part(config, Part::Training, true)?;
    let mut checked = HashSet::new();
    for (_, dataset) in &train {
        // Both cameras of a drive have one speed.
        if checked.insert((dataset.folder().to_owned(), dataset.name().to_owned())) {
            warn_of_speed(dataset);
        }
    }
    let validation = match validates(config) {
        true => Some(open_part(config, Part::Validation, true)?),
        false => None,
    };
    let apart = validation.is_some();
    let (train, validation, skipped) = SampleSet::split_sets(config, train, validation)?;
    for reason in skipped {
        remarks::warn_once(format!("skipped: {reason}"));
    }
    if apart {
        for shared in shared_frames(&train, &validation) {
            remarks::warn_once(format!(
                "{}: {} of its validation frames are neighbours of training frames, and were seen as such",
                shared.drive, shared.sources
            ));
        }
    }
    Ok((train, validation))
}

/// All recordings to train on, with the place of their set in `data.sets`. Nothing is told of them: training did.
pub fn training_recordings(config: &TrainConfig) -> Result<Vec<(usize, Dataset)>> {
    open_part(config, Part::Training, false)
}

/// What recordings are for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Training,
    Validation,
}

/// Whether there are recordings or frames to validate on; else the end of each drive is held out.
fn validates(config: &TrainConfig) -> bool {
    let data = &config.data;
    let own = !data.validation.is_empty() || data.validation_split.is_some();
    own || data.sets.iter().any(DataSetConfig::validates)
}

/// The recordings of one part, with the place of their set in `data.sets`.
fn open_part(config: &TrainConfig, part: Part, tell: bool) -> Result<Vec<(usize, Dataset)>> {
    let data = &config.data;
    if data.sets.is_empty() {
        let validation = (&data.validation, &data.validation_split);
        let (paths, split) = of_part(part, (&data.paths, &data.split), validation);
        let datasets = recordings(paths, split, &data.camera, data.camera_ahead_s, tell)?;
        return Ok(placed(0, datasets));
    }
    let mut all = Vec::new();
    for (i, set) in data.sets.iter().enumerate() {
        let validation = (&set.validation, &set.validation_split);
        let (paths, split) = of_part(part, (&set.paths, &set.split), validation);
        let camera = match set.camera.as_str() {
            "" => &data.camera,
            own => own,
        };
        let ahead_s = set.camera_ahead_s.or(data.camera_ahead_s);
        all.extend(placed(i, recordings(paths, split, camera, ahead_s, tell)?));
    }
    Ok(all)
}

/// Paths and the split file that selects their frames.
type Frames<'a> = (&'a Vec<PathBuf>, &'a Option<PathBuf>);

/// Those of one part. A split of training frames says nothing about which to validate on, nor the other way round.
fn of_part<'a>(
    part: Part,
    training: Frames<'a>,
    validation: Frames<'a>,
) -> (&'a [PathBuf], Option<&'a Path>) {
    let (paths, split) = match part {
        Part::Training => training,
        Part::Validation if validation.0.is_empty() => (training.0, validation.1),
        Part::Validation => validation,
    };
    (paths, split.as_deref())
}

/// Each with the place of its set.
fn placed(set: usize, datasets: Vec<Dataset>) -> Vec<(usize, Dataset)> {
    datasets.into_iter().map(|d| (set, d)).collect()
}

/// The recordings at `paths` of the cameras that a configuration names.
fn recordings(
    paths: &[PathBuf],
    split: Option<&Path>,
    camera: &str,
    camera_ahead_s: Option<f64>,
    tell: bool,
) -> Result<Vec<Dataset>> {
    let camera: CameraChoice = match camera {
        "" => CameraChoice::default(),
        text => text.parse().map_err(|_| Error::Config {
            field: "data.camera",
            expected: "2, 3 or both".into(),
            found: text.into(),
        })?,
    };
    let options = OpenOptions {
        camera,
        split: read_split(split)?,
        camera_ahead_s,
        ..OpenOptions::default()
    };
    match tell {
        true => open_recordings(paths, &options),
        false => open_quietly(paths, &options),
    }
}

fn warn_of_speed(dataset: &Dataset) {
    match speed_unit_warning(dataset) {
        Ok(Some(warning)) => remarks::warn_once(format!("{}: {warning}", dataset.name())),
        Ok(None) => {}
        // The check is a service: what is really wrong with the images, training will say.
        Err(error) => tracing::debug!("speed check of {}: {error}", dataset.name()),
    }
}

/// The run that a path is, or is a checkpoint of; `None` of other weights.
fn run_of(path: &Path) -> Result<Option<(RunFolder, Option<CheckpointKind>)>, Error> {
    let in_a_run = |p: &Path| p.join("config.toml").exists();
    let is_run = path.is_dir() || path.parent().is_some_and(in_a_run);
    is_run.then(|| RunFolder::open(path)).transpose()
}

/// Starts from the networks of a run, or from an ImageNet encoder's weights.
fn initialise(
    model: Model,
    path: &Path,
    config: &TrainConfig,
    device: &burn::tensor::Device,
) -> Result<Model, Error> {
    let device = device.clone().autodiff();
    if let Some((folder, kind)) = run_of(path)? {
        let kind = kind.unwrap_or_else(|| folder.preferred());
        return Ok(folder.load(kind, config, &device)?.0);
    }
    let mut model = model;
    model.depth_net.encoder = load_torchvision_resnet(model.depth_net.encoder, path)?;
    model.pose_net.encoder = load_torchvision_resnet(model.pose_net.encoder, path)?;
    Ok(model)
}
