//! The demo from scratch: six simulated streets, a small untrained network, and a seventh street to evaluate on.

use deepfusion_data::{Cameras, Dataset, OpenOptions};
use deepfusion_jobs::ModelFacts;
use deepfusion_jobs::demo::from_scratch::{
    FromScratchPage, recipe, shown_frames, test_street, training_streets,
};

use super::{Demo, measure};
use crate::commands::command_line;
use crate::commands::recordings::open_datasets;
use crate::failure::Result;
use crate::progress::say;

/// The demo that needs no embedded network.
pub(super) fn run(demo: &Demo) -> Result<()> {
    say("1/4 simulating streets to train on, and another to evaluate on");
    let train_drives = training_streets(&demo.settings)
        .iter()
        .enumerate()
        .map(|(i, street)| demo.simulate(&format!("train-{i}"), street))
        .collect::<Result<Vec<_>>>()?;
    let test_drive = demo.simulate("test", &test_street(&demo.settings))?;

    say("2/4 learning depth from the images and the car's motion (speed, yaw rate)");
    let model = demo.learn(recipe(&demo.settings, &train_drives), Ok)?;

    say("3/4 evaluating on the street never seen");
    let mut estimator = demo.estimator(&model)?;
    let train_sets = open_datasets(&train_drives, None, Cameras::default())?;
    let test_sets = Dataset::open(&test_drive, &OpenOptions::default())?;
    let evaluated = measure(&mut estimator, &train_sets, &test_sets)?;

    say("4/4 pictures, a point cloud and the report");
    let seconds = demo.seconds();
    let factors = model.interval_factors()?;
    let mut shown = Vec::new();
    for frame in shown_frames(test_sets[0].frames().len()) {
        let predicted = demo.predict_frame((&mut estimator, &factors), &test_sets[0], frame)?;
        predicted.write("")?;
        shown.push(predicted);
    }
    if let Some(first) = shown.first() {
        first.write_cloud(&demo.folder.cloud())?;
    }
    let page = FromScratchPage {
        evaluated: &evaluated,
        shown: &shown,
        seconds,
        run: &demo.folder.model(),
        command: &command_line::typed_again(),
    };
    let html = demo.folder.page();
    page.compose()?.write(&html)?;
    demo.end(&evaluated, &html)
}
