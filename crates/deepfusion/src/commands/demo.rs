//! The whole way with no data at all: simulated drives, training, and depth measured on a street
//! that was never seen.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use burn::tensor::Device;
use deepfusion_cloud::PointCloud;
use deepfusion_data::{
    CameraChoice, Dataset, GtKind, OpenOptions, save_png, write_atomically, write_depth_png,
};
use deepfusion_eval::{Crop, GroundTruth, Protocol};
use deepfusion_geometry::DepthMap;
use deepfusion_nn::InputSize;
use deepfusion_render::{
    CloudView, DepthScale, HtmlReport, PictureFormat, depth_picture, error_picture, render_cloud,
    side_by_side, with_depth_legend,
};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{
    CompareAt, Predictor, Preset, Reprojection, RunFolder, TrainConfig, Trainer, ViewMotion,
};

use super::eval::predict;
use super::evaluate::{Evaluated, Truth, evaluate_datasets, open_datasets, trivial_from_datasets};
use super::recorder::clock;
use super::{device, run_report, train};
use crate::cli::{DemoArgs, EngineArgs};
use crate::engine;
use crate::model::ModelSource;
use crate::progress::{Progress, say};
use crate::{interrupt, output};

/// Streets that are trained on, each filmed at its own rate: one street alone is learned by heart. At few
/// frames a second far things move enough to be measured; at many, cars parked beside the lane move
/// little enough to be found.
const FRAMES_PER_SECOND: [f64; 6] = [5.0, 8.0, 12.0, 18.0, 26.0, 36.0];
/// Frames of each.
const STREET_FRAMES: usize = 260;
/// Their pictures: larger than what the network sees, small enough to draw quickly.
const STREET_SIZE: (u32, u32) = (320, 96);
/// Every n-th of their frames has a scan, for the trivial row alone.
const STREET_SCAN_EVERY: usize = 20;
/// Frames of the street that is measured on, and how many of them have a scan.
const TEST_FRAMES: usize = 200;
const TEST_SCAN_EVERY: usize = 8;
/// Steps of training: a few minutes on two cores.
const STEPS: usize = 1500;
/// Small images: many steps in few minutes, and image motion within a network's reach.
const SIZE: (usize, usize) = (192, 64);
/// Far from any seed a user is likely to choose for training.
const TEST_SEED: u64 = 1_000_003;

/// What is told of one that was stopped.
const DEMO: &str = "the demo";

/// `deepfusion demo`.
pub fn run(args: &DemoArgs) -> Result<()> {
    let start = Instant::now();
    let device = device::open(args.device)?;
    let out = output::run_folder(args.out.as_deref(), "demo")?;

    say("1/4 simulating streets to learn on, and another to be measured on");
    let street = |(i, fps): (usize, f64)| SimConfig {
        seed: args.seed.wrapping_add(i as u64),
        frames: STREET_FRAMES,
        width: STREET_SIZE.0,
        height: STREET_SIZE.1,
        scan_every: STREET_SCAN_EVERY,
        fps,
        ..SimConfig::default()
    };
    let train_drives = FRAMES_PER_SECOND
        .into_iter()
        .enumerate()
        .map(|(i, fps)| simulate(&out.join(format!("train-{i}")), &street((i, fps))))
        .collect::<Result<Vec<_>>>()?;
    let test = SimConfig {
        seed: args.seed.wrapping_add(TEST_SEED),
        frames: TEST_FRAMES,
        scan_every: TEST_SCAN_EVERY,
        ..SimConfig::default()
    };
    let test_drive = simulate(&out.join("test"), &test)?;

    say("2/4 learning depth from the images and the car's motion (speed, yaw rate)");
    let mut preset = Preset::Tiny.config();
    // Two frames of a pair show nearly the same: in one direction a step sees twice as many places.
    (preset.reprojection, preset.batch) = (Reprojection::Minimum, 2 * preset.batch);
    preset.loss.compare_at = CompareAt::Own;
    let (width, height) = SIZE;
    let config = TrainConfig {
        view_motion: ViewMotion::Vehicle,
        size: InputSize { width, height },
        steps: Some(STEPS),
        seed: args.seed,
        validate_every: STEPS / 5,
        ..preset
    };
    let model = out.join("model");
    learn(config, &train_drives, &model, &device)?;

    say("3/4 measuring on the street never seen");
    let checkpoint = model.join("last.safetensors");
    let checkpoint = ModelSource::named(&checkpoint)?;
    let predictor = engine::load(&checkpoint, &EngineArgs::on(args.device))?;
    let train_sets = open_datasets(&train_drives, None, CameraChoice::default())?;
    let test_sets = Dataset::open(&test_drive, &OpenOptions::default())?;
    let evaluated = measure(&predictor, &train_sets, &test_sets)?;

    say("4/4 pictures, a point cloud and the report");
    let html = out.join("report.html");
    write_report(
        &out,
        &html,
        &predictor,
        &test_sets[0],
        &evaluated,
        &model,
        start,
    )?;
    let report = &evaluated.report;
    say(&format!(
        "{report}\ndone in {}\nreport  {}\nmodel   {}\ncloud   {}",
        clock(start.elapsed().as_secs_f64()),
        html.display(),
        model.display(),
        out.join("cloud.ply").display(),
    ));
    if args.json {
        output::print_json(report)
    } else {
        output::print(&format!("{}\n", html.display()))
    }
}

fn simulate(out: &Path, config: &SimConfig) -> Result<PathBuf> {
    let simulation = Simulation::new(config)?;
    let mut progress = Progress::new("simulating");
    Ok(write_kitti(&simulation, out, &mut |done, total| {
        progress.set(done, total);
    })?)
}

fn learn(mut config: TrainConfig, drives: &[PathBuf], out: &Path, device: &Device) -> Result<()> {
    config.data.paths = drives.to_vec();
    let sets = train::open_samples(&config)?;
    let folder = RunFolder::create(out)?;
    let mut trainer = Trainer::create(config, folder, sets, device, Ok)?;
    train::train(&mut trainer, None)?;
    interrupt::check(DEMO)
}

fn measure(predictor: &Predictor, train: &[Dataset], test: &[Dataset]) -> Result<Evaluated> {
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
        Some(trivial_from_datasets(train, GtKind::Z)?),
        &mut |dataset, frame| {
            interrupt::check(DEMO)?;
            let image = dataset.load_image(frame)?;
            predict(predictor, &image, &dataset.intrinsics(frame), true)
        },
        &mut |done, total| progress.set(done, total),
    )
}

/// Where the simulator keeps the exact depth of a frame.
fn exact_depth(dataset: &Dataset, frame: usize) -> Result<DepthMap> {
    let name = format!("{:010}.png", dataset.frames()[frame].number);
    let folder = dataset.folder().join("proj_depth/groundtruth/image_02");
    Ok(deepfusion_data::read_depth_png(&folder.join(name))?)
}

fn write_report(
    out: &Path,
    html: &Path,
    predictor: &Predictor,
    dataset: &Dataset,
    evaluated: &Evaluated,
    model: &Path,
    start: Instant,
) -> Result<()> {
    let report = &evaluated.report;
    let scale = DepthScale::default();
    let number = |v: f64| format!("{v:.3}");
    let trivial = report.trivial.as_ref().map(|t| t.unscaled.abs_rel);
    let mut page = HtmlReport::new(
        "DeepFusion: metric depth from one camera and a speed signal",
        "Learned on six simulated streets from images, speed and yaw rate, without any depth label; measured on another",
    )
    .facts(&[
        ("Abs Rel, unscaled", &number(report.unscaled.abs_rel)),
        ("Abs Rel, trivial row", &trivial.map_or("-".into(), number)),
        ("scale (1 is metric)", &number(report.scale.median)),
        ("within 25 %", &format!("{:.1} %", 100.0 * report.unscaled.a1)),
        ("time", &clock(start.elapsed().as_secs_f64())),
    ])
    .section("Accuracy on the street never seen")
    .paragraph(
        "Scans of the simulated LiDAR, Garg's crop, 80 m. Unscaled: the prediction as it is, in \
         metres. Median-scaled: each image multiplied by median(truth) / median(prediction), as \
         methods without a metric scale need. The trivial row predicts each pixel's mean depth over \
         the training streets.",
    );
    page = run_report::accuracy(page, evaluated).section("What it sees");
    let pictures = out.join("pictures");
    std::fs::create_dir_all(&pictures).map_err(|e| deepfusion_data::Error::file(&pictures, e))?;
    let frames = dataset.frames().len();
    for (i, frame) in [frames / 10, frames * 2 / 5, frames * 7 / 10]
        .into_iter()
        .enumerate()
    {
        interrupt::check(DEMO)?;
        let image = dataset.load_image(frame)?;
        let k = dataset.intrinsics(frame);
        let depth = predictor.predict(&image, Some(&k), true, true)?;
        let depth = depth.depth();
        let truth = exact_depth(dataset, frame)?;
        let side = side_by_side(&image, &depth, &scale)?;
        let name = |what: &str| {
            pictures.join(format!("{:010}_{what}.png", dataset.frames()[frame].number))
        };
        save_png(&side, &name("side"))?;
        write_depth_png(&depth, &name("depth"))?;
        page = page.picture(
            &format!(
                "Frame {}: the image, and predicted depth in metres",
                dataset.frames()[frame].number
            ),
            &side,
            PictureFormat::Jpeg,
        )?;
        if i == 0 {
            let exact = with_depth_legend(&depth_picture(&truth, &scale), &scale);
            let errors = error_picture(&image, &depth, &truth)?;
            save_png(&exact, &name("truth"))?;
            save_png(&errors, &name("error"))?;
            page = page
                .picture("The same frame: exact depth", &exact, PictureFormat::Png)?
                .picture(
                    "Relative error of the prediction",
                    &errors,
                    PictureFormat::Png,
                )?;
            let cloud = PointCloud::from_depth(&depth, &k, Some(image.as_raw()), 60.0)?;
            let path = out.join("cloud.ply");
            let mut bytes = Vec::new();
            cloud.write_ply(&mut bytes)?;
            write_atomically::<deepfusion_data::Error>(&path, |file| {
                std::io::Write::write_all(file, &bytes)
                    .map_err(|e| deepfusion_data::Error::file(&path, e))
            })?;
            for (view, caption) in [
                (
                    CloudView::oblique(),
                    "The point cloud, from above and behind the camera",
                ),
                (
                    CloudView::birds_eye(),
                    "The point cloud from straight above, 10 m grid",
                ),
            ] {
                let picture = render_cloud(&cloud, &view, 960, 540);
                page = page.picture(caption, &picture, PictureFormat::Png)?;
            }
        }
    }
    run_report::training(page, model)?
        .section("Again")
        .command("deepfusion demo")
        .write(html)?;
    Ok(())
}
