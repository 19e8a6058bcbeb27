use std::path::{Path, PathBuf};

use anyhow::Result;
use deepfusion_data::{Camera, CameraChoice, Dataset, speed_unit_warning};
use deepfusion_nn::weights::load_torchvision_resnet;
use deepfusion_train::{
    Error, Model, Preset, RunFolder, SampleSet, TrainConfig, Trainer, ViewMotion,
};

use super::device;
use super::evaluate::open_datasets;
use super::recorder::{Recorder, clock};
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

/// Runs a trainer with its logs, and gives the curves for a report.
pub fn train(trainer: &mut Trainer) -> Result<super::recorder::Curves> {
    allocator::keep_memory();
    interrupt::catch("stopping after this step; the run is saved");
    let mut recorder = Recorder::open(trainer.folder(), trainer.step())?;
    let summary = trainer.run(&mut |event| recorder.handle(event))?;
    let curves = recorder.finish()?;
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
    Ok(curves)
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
    config.data.paths.clone_from(&args.data);
    config.data.validation.clone_from(&args.val_data);
    config.data.split.clone_from(&args.split);
    config.data.camera = match args.camera.cameras() {
        [Camera::Left] => "2",
        [Camera::Right] => "3",
        _ => "both",
    }
    .into();
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
    let train = recordings(config, &config.data.paths)?;
    warn_of_speeds(&train);
    let validation = match config.data.validation.as_slice() {
        [] => None,
        paths => Some(recordings(config, paths)?),
    };
    let (train, validation, skipped) = SampleSet::split(config, train, validation)?;
    for reason in skipped {
        tracing::warn!("skipped: {reason}");
    }
    Ok((train, validation))
}

/// The recordings at `paths`, with the configuration's cameras and split.
pub fn recordings(config: &TrainConfig, paths: &[PathBuf]) -> Result<Vec<Dataset>> {
    let camera: CameraChoice = match config.data.camera.as_str() {
        "" => CameraChoice::default(),
        text => text.parse().map_err(|_| Error::Config {
            field: "data.camera",
            expected: "2, 3 or both".into(),
            found: text.into(),
        })?,
    };
    open_datasets(paths, config.data.split.as_deref(), camera)
}

fn warn_of_speeds(datasets: &[Dataset]) {
    for dataset in datasets {
        match speed_unit_warning(dataset) {
            Ok(Some(warning)) => tracing::warn!("{}: {warning}", dataset.name()),
            Ok(None) => {}
            // The check is a service: what is really wrong with the images, training will say.
            Err(error) => tracing::debug!("speed check of {}: {error}", dataset.name()),
        }
    }
}

/// Starts from the networks of a run, or from an ImageNet encoder's weights.
fn initialise(
    model: Model,
    path: &Path,
    config: &TrainConfig,
    device: &burn::tensor::Device,
) -> Result<Model, Error> {
    let device = device.clone().autodiff();
    let is_run = path.is_dir()
        || path
            .parent()
            .is_some_and(|p| p.join("config.toml").exists());
    if is_run {
        let (folder, kind) = RunFolder::open(path)?;
        let kind = kind.unwrap_or_else(|| folder.preferred());
        return Ok(folder.load(kind, config, &device)?.0);
    }
    let mut model = model;
    model.depth_net.encoder = load_torchvision_resnet(model.depth_net.encoder, path)?;
    model.pose_net.encoder = load_torchvision_resnet(model.pose_net.encoder, path)?;
    Ok(model)
}
