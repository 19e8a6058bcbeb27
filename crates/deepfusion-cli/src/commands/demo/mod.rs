//! The whole way with no data at all. The embedded network sees a simulated street zero-shot, learns there from images and
//! motion, and is measured before and after. Or streets are simulated, a small network learns depth on them from scratch,
//! and is measured on another.

mod adapt;
mod from_scratch;
mod page;

use std::path::{Path, PathBuf};
use std::time::Instant;

use burn::tensor::Device;
use deepfusion_data::{Dataset, GtKind};
use deepfusion_eval::{Crop, GroundTruth, Protocol};
use deepfusion_jobs::evaluation::{
    Evaluated, Truth, baseline_from_datasets, evaluate_datasets, predict,
};
use deepfusion_model::{InputSize, RunFolder, TrainConfig};
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use deepfusion_sim::{Error as SimError, SimConfig, Simulation, write_kitti};
use deepfusion_train::{Model, Trainer};
use deepfusion_weights::DEFAULT;

use super::recordings::open_samples;
use super::train;
use crate::cli::{DemoArgs, EngineArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::{Progress, clock, say};
use crate::{devices, engine, interrupt, output};

/// Far from any seed a user is likely to choose for training.
const TEST_SEED: u64 = 1_000_003;

/// Its name in the message that it was stopped.
const DEMO: &str = "the demo";

/// `deepfusion demo`.
pub(super) fn run(args: &DemoArgs) -> Result<()> {
    // The first notice is the one that stands: what training and `perceive` say of going on does not hold here.
    interrupt::catch(
        "stopping after the frames, step or image at work; the demo cannot be resumed",
    );
    let embedded = if args.from_scratch {
        None
    } else {
        Some(Box::new(deepfusion_weights::find(DEFAULT)?))
    };
    let demo = Demo {
        args,
        start: Instant::now(),
        device: devices::open(args.device)?,
        out: output::run_folder(args.out.as_deref(), "demo")?,
    };
    match embedded {
        Some(network) => adapt::run(&demo, network),
        None => from_scratch::run(&demo),
    }
}

/// What both ways have in common.
struct Demo<'a> {
    args: &'a DemoArgs,
    start: Instant,
    device: Device,
    /// Folder for everything.
    out: PathBuf,
}

impl Demo<'_> {
    /// Simulates a drive into a folder of its own; gives the drive's.
    fn simulate(&self, name: &str, config: &SimConfig) -> Result<PathBuf> {
        let simulation = Simulation::new(config)?;
        let mut progress = Progress::new("simulating");
        let out = self.out.join(name);
        let mut listen = |done, total| {
            progress.set(done, total);
            interrupt::flow()
        };
        match write_kitti(&simulation, &out, &mut listen) {
            Err(SimError::Stopped { .. }) => Err(CliError::Ended { what: DEMO }.into()),
            written => {
                let drive = written?;
                // Labels and the disk take a while after the last frame.
                interrupt::check(DEMO)?;
                Ok(drive)
            }
        }
    }

    /// Frames of a drive.
    fn frames(&self, usual: usize) -> usize {
        self.args.frames.map_or(usual, usize::from)
    }

    /// Steps of training.
    fn steps(&self, usual: usize) -> usize {
        self.args.steps.unwrap_or(usual)
    }

    /// Width and height of pictures.
    fn size(&self, usual: (u32, u32)) -> (u32, u32) {
        self.args
            .size
            .map_or(usual, |size| (size.width, size.height))
    }

    /// The size of what the network learns from.
    fn input_size(&self, usual: InputSize) -> InputSize {
        self.args.size.map_or(usual, |size| InputSize {
            width: size.width as usize,
            height: size.height as usize,
        })
    }

    /// Trains into the folder `model`.
    fn learn(
        &self,
        config: TrainConfig,
        initialise: impl FnOnce(Model) -> Result<Model, deepfusion_train::Error>,
    ) -> Result<ModelSource> {
        let sets = open_samples(&config)?;
        let folder = RunFolder::create(&self.model())?;
        let mut trainer = Trainer::create(config, folder, sets, &self.device, initialise)?;
        train::train(&mut trainer, None)?;
        interrupt::check(DEMO)?;
        Ok(ModelSource::named(&self.model().join("last.safetensors"))?)
    }

    fn model(&self) -> PathBuf {
        self.out.join("model")
    }

    fn cloud(&self) -> PathBuf {
        self.out.join("cloud.ply")
    }

    fn estimator(&self, model: &ModelSource) -> Result<DepthEstimator> {
        engine::load(model, &EngineArgs::on(self.args.device))
    }

    /// Prints what it came to and where it lies.
    fn end(&self, evaluated: &Evaluated, page: &Path) -> Result<()> {
        let report = &evaluated.report;
        say(&format!(
            "{report}\ndone in {}\nreport  {}\nmodel   {}\ncloud   {}",
            clock(self.start.elapsed().as_secs_f64()),
            page.display(),
            self.model().display(),
            self.cloud().display(),
        ));
        if self.args.json {
            output::print_json(report)
        } else {
            output::print(&format!("{}\n", page.display()))
        }
    }
}

/// Measures on the scans of `test`, beside the mean depth of the scans of `train`.
fn measure(
    estimator: &mut DepthEstimator,
    train: &[Dataset],
    test: &[Dataset],
) -> Result<Evaluated> {
    let protocol = Protocol {
        crop: Crop::Garg,
        gt: GroundTruth::Z,
        ..Protocol::default()
    };
    let mut progress = Progress::new("evaluating");
    evaluate_datasets(
        test,
        &mut Truth::Scans(GtKind::Z),
        &protocol,
        Some(baseline_from_datasets(train, GtKind::Z)?),
        &mut |dataset, frame| {
            interrupt::check(DEMO)?;
            let image = dataset.load_image(frame)?;
            let camera = dataset.intrinsics(frame);
            Ok(predict(estimator, &image, &camera, true)?)
        },
        &mut |done, total| progress.set(done, total),
    )
}
