use std::path::Path;

use deepfusion_hint::count_of;
use deepfusion_jobs::training::resume::require_no_fewer_steps;
use deepfusion_jobs::training::{
    AskedRecordings, Pace, RunLock, SettingsOfMean, Start, StartReport, StartRequest, TrainingPlan,
    leaves_turns_unused,
};
use deepfusion_model::{CheckpointKind, RunFolder, TrainConfig};
use deepfusion_train::{Device, TrainSummary, Trainer, peak_device_bytes};

use super::recorder::Recorder;
use super::recordings::open_samples;
use super::{clocks, resume};
use crate::allocator;
use crate::cli::TrainArgs;
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::{duration_text, say};
use crate::{devices, interrupt, output};

/// `deepfusion train`.
pub(super) fn run(args: &TrainArgs) -> Result<()> {
    let device = devices::open(args.device)?;
    let (mut trainer, _lock) = match &args.out {
        Some(out) if args.resume => resumed_run(out, args, &device)?,
        _ => new_run(args, &device)?,
    };
    say(&TrainingPlan::of(&trainer).to_string());
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

/// A new run. Errors of its start or its folder are reported before the recordings are opened, which may take long.
fn new_run(args: &TrainArgs, device: &Device) -> Result<(Trainer, RunLock)> {
    if let Some(out) = &args.out {
        output::require_run_folder(out)?;
    }
    let mut config = request(args)?.config(|datasets| clocks::measured(datasets.iter()))?;
    config.validate()?;
    // A configuration file states what its run starts from, if anything.
    let start = Start::of(args.init.as_deref(), &config, args.config.is_none())?;
    if args.init.is_none()
        && matches!(start, Start::Nothing)
        && let Start::Packed { network, .. } = Start::embedded_for(&config)?
    {
        let name = &network.card.name;
        say(&format!(
            "starts from random weights, as the configuration has no `init` (--init {name} starts from the embedded network)"
        ));
    }
    start.record_in(&mut config)?;
    let sets = open_samples(&config)?;
    let folder = output::run_folder(args.out.as_deref(), "train")?;
    let folder = RunFolder::create(&folder)?;
    let lock = RunLock::take(folder.path())?;
    let trainer = Trainer::create(config, folder, sets, device, |model| {
        start.initialise(model, device, &mut print_default_start)
    })?;
    Ok((trainer, lock))
}

/// The run in a folder, to be continued. Its errors, too, are reported before the recordings are opened.
fn resumed_run(out: &Path, args: &TrainArgs, device: &Device) -> Result<(Trainer, RunLock)> {
    let (folder, _) = RunFolder::open(out)?;
    let lock = RunLock::take(folder.path())?;
    let run = folder.read_settings()?;
    let config = resume::with_options(&run, args)?;
    config.validate()?;
    folder.require_checkpoint(CheckpointKind::Last)?;
    if let Some(steps) = config.steps {
        let done = folder.read_state(CheckpointKind::Last)?.step;
        require_no_fewer_steps(&run, &config, done, steps)?;
    }
    let sets = open_samples(&config)
        .map_err(|error| resume::where_recordings_are(error, &config, folder.path()))?;
    let settings = config.clone();
    let trainer = Trainer::resume(config, folder.clone(), sets, device)?;
    // The number of steps of the epochs is known only now.
    require_no_fewer_steps(&run, &settings, trainer.step(), trainer.steps())?;
    // Written only now, since settings with which the run cannot continue are refused above.
    folder.write_config(&settings, &folder.read_findings()?)?;
    Ok((trainer, lock))
}

/// Prints what a run starts from, and warns if that may not be intended.
pub(super) fn print_start(start: StartReport) {
    match start {
        StartReport::OtherMeaning(warning) => tracing::warn!("{warning}"),
        start => say(&start.to_string()),
    }
}

/// As [`print_start`], naming the option that chooses another start.
fn print_default_start(start: StartReport) {
    if matches!(start, StartReport::Packed { path: None, .. }) {
        say(&format!("{start} (--init none starts from random weights)"));
    } else {
        print_start(start);
    }
}

/// Advice where a preset warps with PoseNet's pose, as its network was published, although the recordings have the vehicle's turns.
fn unused_turns(trainer: &Trainer, args: &TrainArgs) -> Option<String> {
    let by_default = args.view_motion.is_none() && args.config.is_none() && !args.resume;
    (by_default && leaves_turns_unused(trainer)).then(|| {
        format!(
            "{} warps with PoseNet's pose, as published; these recordings have a yaw rate, with which --view-motion auto learns metres in far fewer steps",
            trainer.config().preset
        )
    })
}

/// Runs a trainer with its logs, to its last step or until it is asked to stop; with a `pace`, prints how long it will
/// take.
pub(super) fn train(trainer: &mut Trainer, pace: Option<Pace>) -> Result<TrainSummary> {
    allocator::keep_memory();
    interrupt::catch("stopping after the current step; the run is saved");
    let mut recorder = Recorder::open(trainer.folder(), trainer.step(), pace)?;
    let summary = trainer.run(&mut |event| recorder.handle(event))?;
    recorder.finish()?;
    if summary.step < summary.steps {
        // The caller's error says so.
        return Ok(summary);
    }
    say(&format!(
        "done: {} of {} in {}{}",
        summary.step,
        count_of(summary.steps, "step"),
        duration_text(summary.seconds),
        if summary.skipped > 0 {
            format!(
                ", {} skipped because of a gradient that was not finite",
                summary.skipped
            )
        } else {
            String::new()
        }
    ));
    Ok(summary)
}

/// Warns if the settings are those of one of the runs of a mean. Not needed with `--init`, which states what to start from.
fn warn_of_mean(file: &Path, config: &TrainConfig, args: &TrainArgs) {
    if args.init.is_none()
        && let Ok(Some(mean)) = SettingsOfMean::of(file, config)
    {
        match &mean.folder {
            Some(folder) => {
                tracing::warn!(
                    "{mean} (--init {} continues from the mean)",
                    folder.display()
                );
            }
            None => tracing::warn!("{mean}"),
        }
    }
}

/// Refuses a term that is both switched on and left out.
pub(super) fn check_terms(with: &[String], without: &[String]) -> Result<()> {
    if let Some(term) = with.iter().find(|term| without.contains(term)) {
        let term = term.clone();
        return Err(CliError::OnAndOff { term }.into());
    }
    Ok(())
}

fn request(args: &TrainArgs) -> Result<StartRequest> {
    check_terms(&args.with, &args.without)?;
    let file = match &args.config {
        Some(path) => {
            let config = TrainConfig::read_over_preset(path, args.device.compute())?;
            warn_of_mean(path, &config, args);
            Some(Box::new(config))
        }
        None => None,
    };
    Ok(StartRequest {
        file,
        preset: args.preset,
        compute: args.device.compute(),
        steps: args.steps,
        epochs: args.epochs,
        size: args.size.map(Into::into),
        batch: args.batch,
        seed: args.seed,
        learned_camera: args.intrinsics.is_some(),
        view_motion: args.view_motion,
        with: args.with.clone(),
        without: args.without.clone(),
        assignments: args.set.clone(),
        recordings: asked_recordings(args),
    })
}

/// The recordings that options ask for.
fn asked_recordings(args: &TrainArgs) -> AskedRecordings {
    AskedRecordings {
        paths: args.data.clone(),
        validation: args.val_data.clone(),
        split: args.split.clone(),
        validation_split: args.val_split.clone(),
        camera: args.camera,
        stereo: args.stereo,
        learn: args.learn,
        clock: args.clock_offset.map(clocks::ahead),
        topics: args.topics.clone(),
    }
}
