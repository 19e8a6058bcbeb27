use std::path::Path;

use deepfusion_data::Cameras;
use deepfusion_hint::count_of;
use deepfusion_jobs::recordings::{camera_word, training_recordings};
use deepfusion_jobs::training::{Began, Pace, SettingsOfMean, Start};
use deepfusion_model::{
    DataConfig, Error as ModelError, InputSize, Learn, Preset, Reprojection, RunFolder,
    TrainConfig, ViewMotion,
};
use deepfusion_train::{TrainSummary, Trainer, peak_device_bytes};

use super::recorder::Recorder;
use super::recordings::open_samples;
use super::{clocks, resume};
use crate::allocator;
use crate::cli::{ClockOffset, TrainArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::{clock, say};
use crate::{devices, interrupt, jobs, output};

/// `deepfusion train`.
pub(super) fn run(args: &TrainArgs) -> Result<()> {
    let device = devices::open(args.device)?;
    let resumed = match (&args.out, args.resume) {
        (Some(out), true) => Some(RunFolder::open(out)?.0),
        _ => None,
    };
    let mut config = match &resumed {
        Some(folder) => resume::with_options(&folder.read_settings()?, args)?,
        None => start_config(args)?,
    };
    config.validate()?;
    let sets = open_samples(&config).map_err(|error| match &resumed {
        Some(folder) => resume::where_recordings_are(error, &config, folder.path()),
        None => error,
    })?;
    let mut trainer = match resumed {
        Some(folder) => {
            folder.write_config(&config, &folder.read_findings()?)?;
            Trainer::resume(config, folder, sets, &device)?
        }
        None => {
            // A file says what its run starts from, if anything.
            let start = Start::of(args.init.as_deref(), &config, args.config.is_none())?;
            if args.init.is_none()
                && matches!(start, Start::Nothing)
                && let Start::Packed { network, .. } = Start::embedded_for(&config)?
            {
                let name = &network.card.name;
                say(&format!(
                    "starts from nothing, as the configuration names no init (--init {name} starts from the embedded network)"
                ));
            }
            start.record_in(&mut config)?;
            let folder = output::run_folder(args.out.as_deref(), "train")?;
            let folder = RunFolder::create(&folder)?;
            Trainer::create(config, folder, sets, &device, |model| {
                start.initialise(model, &device, &mut began_by_default)
            })?
        }
    };
    say(&plan(&trainer));
    if let Some(advice) = unused_turns(&trainer, args) {
        say(&advice);
    }
    let pace = Pace::of(trainer.config().clone(), args.device.compute());
    let summary = train(&mut trainer, Some(pace))?;
    if let Some(bytes) = peak_device_bytes(&device) {
        let megabytes = devices::megabytes(bytes);
        say(&format!("memory of the device: {megabytes:.0} MB at most"));
    }
    if summary.step < summary.steps {
        let folder = trainer.folder().display();
        return Err(CliError::Stopped {
            step: summary.step,
            steps: summary.steps,
            go_on: format!("deepfusion train --out {folder} --resume"),
        }
        .into());
    }
    output::print(&format!("{}\n", trainer.folder().display()))
}

/// Prints what a run starts from.
pub(super) fn began(began: Began) {
    say(&began.to_string());
}

/// As [`began`], where an option chooses otherwise.
fn began_by_default(began: Began) {
    let embedded = matches!(began, Began::Packed { path: None, .. });
    let hint = if embedded {
        " (--init none starts from nothing)"
    } else {
        ""
    };
    say(&format!("{began}{hint}"));
}

/// A preset takes PoseNet's pose because that is how its network was published, and the recordings know better.
fn unused_turns(trainer: &Trainer, args: &TrainArgs) -> Option<String> {
    let (config, samples) = (trainer.config(), trainer.samples());
    let by_default = args.view_motion.is_none() && args.config.is_none() && !args.resume;
    let unused = config.view_motion == ViewMotion::PoseNet && config.loss.speed > 0.0;
    let known = !samples.samples.is_empty() && samples.without_turns().is_empty();
    (by_default && unused && known).then(|| {
        format!(
            "{} warps by PoseNet's pose, as published; these recordings have a yaw rate, and --view-motion auto learns metres in far fewer steps",
            config.preset
        )
    })
}

/// What will be done: the network, its images, and how many steps and why.
fn plan(trainer: &Trainer) -> String {
    let config = trainer.config();
    let InputSize { width, height } = config.size;
    let epochs = config.epochs * trainer.epoch_steps();
    let steps = match config.steps {
        None if epochs < config.min_steps => format!(
            "{} (the least: {} epochs of so few images would be {epochs})",
            count_of(trainer.steps(), "step"),
            config.epochs
        ),
        None => count_of(config.epochs, "epoch"),
        Some(steps) => count_of(steps, "step"),
    };
    let sets = 0..config.data.sets.len().max(1);
    let learned = |from: fn(Learn) -> bool| sets.clone().any(|set| from(config.learn(set)));
    let batches = [
        (learned(Learn::from_motion), config.batch, "of video"),
        (
            learned(Learn::from_depth),
            config.depth_batch(),
            "of known depth",
        ),
    ];
    let samples = batches
        .iter()
        .filter(|(learned, ..)| *learned)
        .map(|(_, batch, kind)| format!("{} {kind}", batch * config.accumulate));
    let samples: Vec<String> = samples.collect();
    format!(
        "{}: images of {width}x{height}, {} a step, {steps}",
        config.preset,
        samples.join(" and ")
    )
}

/// Runs a trainer with its logs, to its last step or until it is asked to stop; with a `pace`, how long it will
/// take is said.
pub(super) fn train(trainer: &mut Trainer, pace: Option<Pace>) -> Result<TrainSummary> {
    allocator::keep_memory();
    interrupt::catch("stopping after this step; the run is saved");
    let mut recorder = Recorder::open(trainer.folder(), trainer.step(), pace)?;
    let summary = trainer.run(&mut |event| recorder.handle(event))?;
    recorder.finish()?;
    say(&format!(
        "{} {} of {} steps in {}{}",
        if summary.step < summary.steps {
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
    Ok(summary)
}

/// Warns of settings that are another run's. Who says what to begin from has said what is meant.
fn warn_of_mean(config: &Path, args: &TrainArgs) {
    if args.init.is_none()
        && let Ok(Some(mean)) = SettingsOfMean::of(config)
    {
        let folder = config.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new(".")).display();
        tracing::warn!("{mean} (--init {folder} goes on from the mean)");
    }
}

fn start_config(args: &TrainArgs) -> Result<TrainConfig> {
    let mut config = match &args.config {
        Some(path) => {
            let config = TrainConfig::read_over_preset(path, args.device.compute())?;
            warn_of_mean(path, args);
            config
        }
        None => {
            let preset = args.preset.unwrap_or(Preset::Tiny);
            preset.config_on(args.device.compute())
        }
    };
    if let Some(size) = args.size {
        config.size.width = size.width as usize;
        config.size.height = size.height as usize;
    }
    config.steps = args.steps.or(config.steps);
    if let Some(epochs) = args.epochs {
        (config.epochs, config.steps, config.min_steps) = (epochs, None, 0);
    }
    config.batch = args.batch.unwrap_or(config.batch);
    config.seed = args.seed.unwrap_or(config.seed);
    for term in &args.with {
        config.with(term)?;
    }
    for term in &args.without {
        config.without(term)?;
    }
    if args.stereo {
        (config.stereo, config.reprojection) = (true, Reprojection::Minimum);
    }
    // Said last: a motion that contradicts a term left out is an error, and not silently another one.
    config.view_motion = args.view_motion.unwrap_or(config.view_motion);
    if args.intrinsics.is_some() {
        let camera = config.assumed_camera.get_or_insert_default();
        camera.learn = true;
    }
    for assignment in &args.set {
        config.set(assignment)?;
    }
    choose_recordings(&mut config.data, args)?;
    if args.clock_offset == Some(ClockOffset::Auto) {
        // Measured against what the recordings' own files say, and kept in the configuration as a number.
        config.data.camera_ahead_s = None;
        let mut measured = config.clone();
        // Turns of the images would be on the camera's clock.
        measured.data.measured_turns_only = true;
        let datasets = training_recordings(&measured).map_err(jobs::in_words)?;
        let ahead_s = clocks::measured(datasets.iter().map(|(_, dataset)| dataset))?;
        config.data.camera_ahead_s = Some(ahead_s);
    }
    Ok(config)
}

/// The file's own recordings, each part of which an option replaces where it is given.
fn choose_recordings(data: &mut DataConfig, args: &TrainArgs) -> Result<(), ModelError> {
    let given = [
        ("--data", !args.data.is_empty()),
        ("--val-data", !args.val_data.is_empty()),
        ("--split", args.split.is_some()),
        ("--val-split", args.val_split.is_some()),
        // The sets' own where each has one; else it is the camera of those that have none.
        (
            "--camera",
            args.camera.is_some() && data.sets.iter().any(|set| !set.camera.is_empty()),
        ),
        ("--learn", args.learn.is_some()),
        (
            "--clock-offset",
            args.clock_offset.is_some() && data.sets.iter().any(|set| set.camera_ahead_s.is_some()),
        ),
        (
            "--topic",
            !args.topics.is_empty() && data.sets.iter().any(|set| !set.topics.is_empty()),
        ),
    ];
    for (field, given) in given {
        if given && !data.sets.is_empty() {
            return Err(ModelError::Config {
                field,
                expected: "none beside [[data.sets]] in the config file: each set has its own"
                    .into(),
                found: "both".into(),
            });
        }
    }
    if !args.data.is_empty() {
        data.paths.clone_from(&args.data);
    }
    if !args.val_data.is_empty() {
        data.validation.clone_from(&args.val_data);
    }
    if args.split.is_some() {
        data.split.clone_from(&args.split);
    }
    if args.val_split.is_some() {
        data.validation_split.clone_from(&args.val_split);
    }
    if let Some(ClockOffset::Seconds(ahead_s)) = args.clock_offset {
        data.camera_ahead_s = Some(ahead_s);
    }
    if !args.topics.is_empty() {
        data.topics = args.topics.iter().map(ToString::to_string).collect();
    }
    data.learn = args.learn.unwrap_or(data.learn);
    if let Some(camera) = args.camera {
        data.camera = camera_word(camera).into();
    } else if args.stereo {
        data.camera = camera_word(Cameras::Both).into();
    } else if data.camera.is_empty() && data.sets.is_empty() {
        data.camera = camera_word(Cameras::default()).into();
    }
    if data.paths.is_empty() && data.sets.is_empty() {
        return Err(ModelError::Config {
            field: "data",
            expected: "--data, or data.paths or [[data.sets]] in the config file".into(),
            found: "none".into(),
        });
    }
    Ok(())
}
