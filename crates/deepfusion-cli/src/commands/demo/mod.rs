//! `deepfusion demo`: all steps, without any data. The embedded network is evaluated zero-shot on a simulated street, trained there with
//! images and motion, and evaluated again. Or a small network is trained from scratch on simulated streets and evaluated on another.

mod adapt;
mod from_scratch;

use std::path::{Path, PathBuf};
use std::time::Instant;

use deepfusion_data::Dataset;
use deepfusion_eval::IntervalFactors;
use deepfusion_jobs::demo::{self, DemoFolder, DemoSettings, ShownPrediction};
use deepfusion_jobs::evaluation::Evaluated;
use deepfusion_model::{RunFolder, TrainConfig};
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use deepfusion_sim::{Error as SimError, SimConfig, Simulation, write_kitti};
use deepfusion_train::{Device, Model, Trainer};
use deepfusion_weights::DEFAULT;

use super::recordings::open_samples;
use super::train;
use crate::cli::{DemoArgs, EngineArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::{Progress, duration_text, say};
use crate::{devices, engine, interrupt, output};

/// The demo's name in the message that it was stopped.
const DEMO: &str = "the demo";

/// `deepfusion demo`.
pub(super) fn run(args: &DemoArgs) -> Result<()> {
    // Only the first notice is used: those of training and `perceive`, about continuing, do not apply here.
    interrupt::catch(
        "stopping after the current frames, step or image; the demo cannot be resumed",
    );
    let embedded = if args.from_scratch {
        None
    } else {
        Some(Box::new(deepfusion_weights::find(DEFAULT)?))
    };
    let demo = Demo {
        args,
        start: Instant::now(),
        settings: settings(args),
        device: devices::open(args.device)?,
        folder: DemoFolder::new(output::run_folder(args.out.as_deref(), "demo")?),
    };
    match embedded {
        Some(network) => adapt::run(&demo, network),
        None => from_scratch::run(&demo),
    }
}

fn settings(args: &DemoArgs) -> DemoSettings {
    DemoSettings {
        seed: args.seed,
        frames: args.frames.map(usize::from),
        steps: args.steps,
        size: args.size.map(|size| (size.width, size.height)),
        compute: args.device.compute(),
    }
}

/// What both demos have in common.
struct Demo<'a> {
    args: &'a DemoArgs,
    start: Instant,
    settings: DemoSettings,
    device: Device,
    folder: DemoFolder,
}

impl Demo<'_> {
    /// Simulates a drive into its own folder and returns the drive's path.
    fn simulate(&self, name: &str, config: &SimConfig) -> Result<PathBuf> {
        let simulation = Simulation::new(config)?;
        let mut progress = Progress::new("simulating");
        let out = self.folder.join(name);
        let mut listen = |done, total| {
            progress.set(done, total);
            interrupt::flow()
        };
        match write_kitti(&simulation, &out, &mut listen) {
            Err(SimError::Stopped { .. }) => Err(CliError::Ended { what: DEMO }.into()),
            written => {
                let drive = written?;
                // After the last frame, labels are still written, which takes a while.
                interrupt::check(DEMO)?;
                Ok(drive)
            }
        }
    }

    /// Trains into the folder `model`.
    fn learn(
        &self,
        config: TrainConfig,
        initialise: impl FnOnce(Model) -> Result<Model, deepfusion_train::Error>,
    ) -> Result<ModelSource> {
        let sets = open_samples(&config)?;
        let folder = RunFolder::create(&self.folder.model())?;
        let mut trainer = Trainer::create(config, folder, sets, &self.device, initialise)?;
        train::train(&mut trainer, None)?;
        interrupt::check(DEMO)?;
        let checkpoint = self.folder.model().join("last.safetensors");
        Ok(ModelSource::named(&checkpoint)?)
    }

    fn estimator(&self, model: &ModelSource) -> Result<DepthEstimator> {
        engine::load(model, &EngineArgs::on(self.args.device))
    }

    /// A frame of a drive, and the depth that a network predicts for it.
    fn predict_frame(
        &self,
        network: (&mut DepthEstimator, &IntervalFactors),
        drive: &Dataset,
        frame: usize,
    ) -> Result<ShownPrediction> {
        interrupt::check(DEMO)?;
        Ok(ShownPrediction::of(
            network,
            drive,
            frame,
            self.folder.pictures(),
        )?)
    }

    /// Seconds since the demo started.
    fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Prints the metrics and the paths of the outputs.
    fn end(&self, evaluated: &Evaluated, page: &Path) -> Result<()> {
        let report = &evaluated.report;
        say(&format!(
            "{report}\ndone in {}\nreport  {}\nmodel   {}\ncloud   {}",
            duration_text(self.seconds()),
            page.display(),
            self.folder.model().display(),
            self.folder.cloud().display(),
        ));
        if self.args.json {
            output::print_json(report)
        } else {
            output::print(&format!("{}\n", page.display()))
        }
    }
}

/// As [`demo::measure`], with progress; it can be stopped between two frames.
fn measure(
    estimator: &mut DepthEstimator,
    train: &[Dataset],
    test: &[Dataset],
) -> Result<Evaluated> {
    let mut progress = Progress::new("evaluating");
    demo::measure(
        estimator,
        train,
        test,
        &mut || interrupt::check(DEMO),
        &mut |done, total| progress.set(done, total),
    )
}
