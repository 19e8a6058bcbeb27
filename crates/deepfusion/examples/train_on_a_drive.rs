//! Trains metric depth on a drive, starting from the network that comes with the library.
//!
//! ```text
//! cargo run --release --example train_on_a_drive -- DRIVE RUN [STEPS]
//! ```

use std::path::PathBuf;

use anyhow::{Context, Result};
use deepfusion::data::{Dataset, OpenOptions};
use deepfusion::model::{Compute, Preset, RunFolder};
use deepfusion::runtime::ModelSource;
use deepfusion::train::{Control, Device, SampleSet, TrainEvent, Trainer, ViewMotion};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: train_on_a_drive DRIVE RUN [STEPS]";
    let drive = PathBuf::from(arguments.next().context(usage)?);
    let run = PathBuf::from(arguments.next().context(usage)?);
    let steps = arguments.next().map_or(Ok(300), |s| s.parse())?;

    let source = ModelSource::named("street".as_ref())?;
    let start = source.load(None)?;
    // The preset that the network was built from.
    let mut config = Preset::Light.config_on(Compute::Processor);
    config.canonical_focal_px = start.config.canonical_focal_px;
    // The network that a run started from is part of its training data's record.
    config.init = Some("street".into());
    config.init_sha256 = source.packed_sha256().map(Into::into);
    config.view_motion = ViewMotion::Vehicle;
    config.learning_rate = 5e-5;
    config.steps = Some(steps);

    let drives = Dataset::open(&drive, &OpenOptions::default())?;
    let (samples, held_out, skipped) = SampleSet::split(&config, drives, None)?;
    for reason in skipped {
        eprintln!("skipped: {reason}");
    }
    let run = RunFolder::create(&run)?;
    let device = Device::flex();
    let sets = (samples, held_out);
    let mut trainer = Trainer::create(config, run, sets, &device, |mut model| {
        model.depth_net = model.depth_net.with_weights(&start.weights)?.0;
        Ok(model)
    })?;
    let summary = trainer.run(&mut |event| {
        if let TrainEvent::Step { step, losses, .. } = event {
            println!("step {step}: loss {:.4}", losses.total);
        }
        Control::Continue
    })?;
    println!("{} steps, {}", summary.step, trainer.folder().display());
    Ok(())
}
