//! From scratch: six simulated streets, a small network that knows nothing, and a seventh street to be measured on.

use deepfusion_data::{Cameras, Dataset, OpenOptions};
use deepfusion_jobs::ModelFacts;
use deepfusion_model::{CompareAt, InputSize, Preset, Reprojection, TrainConfig, ViewMotion};
use deepfusion_render::HtmlReport;
use deepfusion_sim::SimConfig;

use super::page::{self, Shown};
use super::{Demo, TEST_SEED, measure};
use crate::commands::recordings::open_datasets;
use crate::commands::run_report;
use crate::failure::Result;
use crate::progress::{clock, say};

/// Streets that are trained on, each filmed at its own rate: one street alone is learned by heart. At few
/// frames a second far things move enough to be measured; at many, cars parked beside the lane move
/// little enough to be found.
const FRAMES_PER_SECOND: [f64; 6] = [5.0, 8.0, 12.0, 18.0, 26.0, 36.0];
/// Frames of each.
const STREET_FRAMES: usize = 260;
/// Their pictures: larger than what the network sees, small enough to draw quickly.
const STREET_SIZE: (u32, u32) = (320, 96);
/// Every n-th of their frames has a scan, for the mean-depth baseline alone.
const STREET_SCAN_EVERY: usize = 20;
/// Frames of the street that is measured on, and how many of them have a scan.
const TEST_FRAMES: usize = 200;
const TEST_SCAN_EVERY: usize = 8;
/// Steps of training: a few minutes on two cores.
const STEPS: usize = 1500;
/// Small images: many steps in few minutes, and image motion within a network's reach.
const SIZE: (usize, usize) = (192, 64);

/// The demo that needs no embedded network.
pub(super) fn run(demo: &Demo) -> Result<()> {
    say("1/4 simulating streets to learn on, and another to be measured on");
    let seed = demo.args.seed;
    let (width, height) = demo.size(STREET_SIZE);
    let street = |(i, fps): (usize, f64)| SimConfig {
        seed: seed.wrapping_add(i as u64),
        frames: demo.frames(STREET_FRAMES),
        width,
        height,
        scan_every: STREET_SCAN_EVERY,
        fps,
        ..SimConfig::default()
    };
    let train_drives = FRAMES_PER_SECOND
        .into_iter()
        .enumerate()
        .map(|(i, fps)| demo.simulate(&format!("train-{i}"), &street((i, fps))))
        .collect::<Result<Vec<_>>>()?;
    let usual = SimConfig::default();
    let (width, height) = demo.size((usual.width, usual.height));
    let test = SimConfig {
        seed: seed.wrapping_add(TEST_SEED),
        frames: demo.frames(TEST_FRAMES),
        width,
        height,
        scan_every: TEST_SCAN_EVERY,
        ..usual
    };
    let test_drive = demo.simulate("test", &test)?;

    say("2/4 learning depth from the images and the car's motion (speed, yaw rate)");
    let mut preset = Preset::Tiny.config();
    // Two frames of a pair show nearly the same: in one direction a step sees twice as many places.
    (preset.reprojection, preset.batch) = (Reprojection::Minimum, 2 * preset.batch);
    preset.loss.compare_at = CompareAt::Own;
    preset.data.paths.clone_from(&train_drives);
    let (width, height) = SIZE;
    let steps = demo.steps(STEPS);
    let config = TrainConfig {
        view_motion: ViewMotion::Vehicle,
        size: demo.input_size(InputSize { width, height }),
        steps: Some(steps),
        seed,
        validate_every: steps / 5,
        ..preset
    };
    let model = demo.learn(config, Ok)?;

    say("3/4 measuring on the street never seen");
    let mut estimator = demo.estimator(&model)?;
    let train_sets = open_datasets(&train_drives, None, Cameras::default())?;
    let test_sets = Dataset::open(&test_drive, &OpenOptions::default())?;
    let evaluated = measure(&mut estimator, &train_sets, &test_sets)?;

    say("4/4 pictures, a point cloud and the report");
    let report = &evaluated.report;
    let number = |v: f64| format!("{v:.3}");
    let mean_depth_baseline = report
        .mean_depth_baseline
        .as_ref()
        .map(|t| t.unscaled.abs_rel);
    let mut page = HtmlReport::new(
        "DeepFusion: metric depth from one camera and a speed signal",
        "Learned from scratch on six simulated streets from images, speed and yaw rate, without any depth label; measured on another",
    )
    .facts(&[
        ("Abs Rel, unscaled", &number(report.unscaled.abs_rel)),
        ("Abs Rel, mean-depth baseline", &mean_depth_baseline.map_or("-".into(), number)),
        ("scale (1 is metric)", &number(report.scale.median)),
        ("within 25 %", &format!("{:.1} %", 100.0 * report.unscaled.a1)),
        ("time", &clock(demo.start.elapsed().as_secs_f64())),
    ])
    .section("Accuracy on the street never seen")
    .paragraph(page::PROTOCOL);
    page = run_report::accuracy(page, &evaluated).section("What it sees");
    let factors = model.interval_factors()?;
    let frames = test_sets[0].frames().len();
    for (i, frame) in [frames / 10, frames * 2 / 5, frames * 7 / 10]
        .into_iter()
        .enumerate()
    {
        let shown = Shown::of(demo, (&mut estimator, &factors), &test_sets[0], frame)?;
        shown.write("")?;
        page = shown.add_to(page, "predicted depth in metres")?;
        if i == 0 {
            page = shown.add_truth_to(page)?;
            shown.write_cloud(&demo.cloud())?;
            page = shown.add_cloud_to(page)?;
        }
    }
    let html = demo.out.join("report.html");
    run_report::training(page, &demo.model())?
        .section("Again")
        .command(&run_report::command())
        .write(&html)?;
    demo.end(&evaluated, &html)
}
