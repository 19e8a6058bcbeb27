//! With the embedded network: what it sees zero-shot, on a street it has never seen, and what learning there adds.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser;
use deepfusion_data::{Dataset, OpenOptions, Split};
use deepfusion_jobs::ModelFacts;
use deepfusion_jobs::evaluation::Evaluated;
use deepfusion_jobs::recordings::write_split;
use deepfusion_jobs::training::Start;
use deepfusion_model::{TrainConfig, ViewMotion};
use deepfusion_nn::ops::{Precision, supports};
use deepfusion_render::{HtmlReport, PictureFormat};
use deepfusion_runtime::ModelSource;
use deepfusion_sim::SimConfig;
use deepfusion_weights::{DEFAULT, Shipped};

use super::page::{self, Shown};
use super::{DEMO, Demo, measure};
use crate::cli::PerceiveArgs;
use crate::commands::{perceive, run_report, train};
use crate::failure::Result;
use crate::interrupt;
use crate::progress::{clock, say};

/// Added to the demo's seed. What learning adds differs from street to street: docs/BENCHMARKS.md.
const STREET_SEED: u64 = 21;
/// Frames of the drive along the new street, ten a second, and how many of them have a scan.
const FRAMES: usize = 200;
const SCAN_EVERY: usize = 5;
/// Cars that drive there.
const MOVING_CARS: usize = 6;
/// Of these, frames that it learns from; those after the gap are measured on.
const LEARNED: usize = 120;
const GAP: usize = 5;
/// Steps of learning, and samples of a step: about two minutes on two cores.
const STEPS: usize = 60;
const BATCH: usize = 2;
/// A network that knows its trade takes smaller steps than one that begins.
const LEARNING_RATE: f64 = 2e-5;

/// Arguments of `perceive` alone.
#[derive(Parser)]
struct Typed {
    #[command(flatten)]
    args: PerceiveArgs,
}

/// The demo of an embedded network.
pub(super) fn run(demo: &Demo, network: Box<Shipped>) -> Result<()> {
    say("1/4 simulating a drive along a street that no network has seen");
    let usual = SimConfig::default();
    let (width, height) = demo.size((usual.width, usual.height));
    let frames = demo.frames(FRAMES);
    let street = SimConfig {
        seed: demo.args.seed.wrapping_add(STREET_SEED),
        frames,
        width,
        height,
        scan_every: SCAN_EVERY,
        moving_cars: MOVING_CARS,
        varied: true,
        ..usual
    };
    let drive = demo.simulate("street", &street)?;
    let parts = SplitDrive::of(demo, &drive)?;

    say(&format!(
        "2/4 depth in metres, a point cloud and 3D targets, from the embedded network `{}` of {}",
        network.card.name, network.card.date
    ));
    let shipped = ModelSource::Packed {
        given: DEFAULT.into(),
        network: network.clone(),
    };
    let mut estimator = demo.estimator(&shipped)?;
    let measured = measured_of(frames);
    let frame = measured.start + measured.len() / 3;
    let before = Instant::now();
    let factors = shipped.interval_factors()?;
    let first = Shown::of(demo, (&mut estimator, &factors), &parts.all, frame)?;
    let first_ms = 1e3 * before.elapsed().as_secs_f64();
    let (picture, cloud) = (first.write("")?, demo.cloud());
    first.write_cloud(&cloud)?;
    say(&format!(
        "an image became metres in {first_ms:.0} ms\npicture {}\ncloud   {}",
        picture.display(),
        cloud.display()
    ));
    let targets = demo.out.join("targets");
    let followed = perceive(demo, &drive, &targets);
    // Before what it says of being interrupted: this is no command that can be repeated.
    interrupt::check(DEMO)?;
    followed?;
    let zero_shot = measure(&mut estimator, &parts.learned, &parts.measured)?;
    say(&format!(
        "abs_rel {:.3} unscaled, from one image and nothing learned here",
        zero_shot.report.unscaled.abs_rel
    ));

    say("3/4 learning on the street's first part from images, speed and yaw rate");
    let start = Start::Packed {
        network,
        path: None,
    };
    let own = estimator.config();
    let precision = if supports(&demo.device, Precision::Bf16) {
        Precision::Bf16
    } else {
        Precision::F32
    };
    let steps = demo.steps(STEPS);
    let mut config = TrainConfig {
        view_motion: ViewMotion::Vehicle,
        // The views are warped by the vehicle's motion, and nobody asks for another.
        freeze: vec![TrainConfig::POSE_NET.into()],
        precision,
        size: demo.input_size(own.size),
        batch: BATCH,
        steps: Some(steps),
        learning_rate: LEARNING_RATE,
        seed: demo.args.seed,
        validate_every: steps / 2,
        ..own.preset.config_on(demo.args.device.compute())
    };
    // Two pictures of one street say little of how pictures are distributed.
    config.depth_net.encoder.frozen_statistics = true;
    config.data.paths = vec![drive.clone()];
    config.data.split = Some(parts.learn.clone());
    start.record_in(&mut config)?;
    let adapted = demo.learn(config, |model| {
        start.initialise(model, &demo.device, &mut train::print_start)
    })?;

    say("4/4 measuring again on the part that was not learned from; pictures and the report");
    let mut estimator = demo.estimator(&adapted)?;
    let learned = measure(&mut estimator, &parts.learned, &parts.measured)?;
    let factors = adapted.interval_factors()?;
    let second = Shown::of(demo, (&mut estimator, &factors), &parts.all, frame)?;
    second.write("_learned")?;
    let html = demo.out.join("report.html");
    let overlay = overlay_of(&targets, &first)?;
    report(
        demo,
        first_ms,
        (&first, &zero_shot),
        (&second, &learned),
        overlay.as_deref(),
        &html,
    )?;
    say(&format!("targets deepfusion view {}", targets.display()));
    demo.end(&learned, &html)
}

/// Which of a drive's frames are learned from: as large a part as of the usual drive.
fn learned_of(frames: usize) -> Range<usize> {
    0..frames * LEARNED / FRAMES
}

/// Which are measured on.
fn measured_of(frames: usize) -> Range<usize> {
    let gap = (frames * GAP).div_ceil(FRAMES);
    learned_of(frames).end + gap..frames
}

/// The drive's first part, to learn from, and its last, to be measured on.
struct SplitDrive {
    all: Dataset,
    learned: Vec<Dataset>,
    measured: Vec<Dataset>,
    /// Split file of the first.
    learn: PathBuf,
}

impl SplitDrive {
    fn of(demo: &Demo, drive: &Path) -> Result<Self> {
        let open = |split: Option<&Path>| -> Result<Vec<Dataset>> {
            let split = split.map(Split::read).transpose()?;
            Ok(Dataset::open(
                drive,
                &OpenOptions {
                    split,
                    ..OpenOptions::default()
                },
            )?)
        };
        let all = open(None)?.swap_remove(0);
        let list = |name: &str, part: Range<usize>| -> Result<PathBuf> {
            let path = demo.out.join(name);
            write_split(&all, part, &path)?;
            Ok(path)
        };
        let frames = all.frames().len();
        let learn = list("learned.txt", learned_of(frames))?;
        let measure = list("measured.txt", measured_of(frames))?;
        Ok(Self {
            learned: open(Some(&learn))?,
            measured: open(Some(&measure))?,
            all,
            learn,
        })
    }
}

/// 3D targets of the whole drive, followed over time, with pictures: the program's own command, which takes the embedded
/// network where none is named.
fn perceive(demo: &Demo, drive: &Path, out: &Path) -> Result<()> {
    let device = demo.args.device.to_string();
    let words = [
        "perceive".as_ref(),
        drive.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
        "--device".as_ref(),
        device.as_ref(),
    ];
    perceive::run(&Typed::try_parse_from(words)?.args)
}

/// The picture that `perceive` drew of a frame.
fn overlay_of(targets: &Path, shown: &Shown) -> Result<Option<PathBuf>> {
    let end = format!("{:010}_overlay.png", shown.number());
    let failed = |e| deepfusion_data::Error::file(targets, e);
    for entry in std::fs::read_dir(targets).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.to_string_lossy().ends_with(&end) {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

/// The page: what it sees zero-shot and after learning.
fn report(
    demo: &Demo,
    first_ms: f64,
    (first, zero_shot): (&Shown, &Evaluated),
    (second, learned): (&Shown, &Evaluated),
    overlay: Option<&Path>,
    html: &Path,
) -> Result<()> {
    let number = |v: f64| format!("{v:.3}");
    let (before, after) = (&zero_shot.report, &learned.report);
    let mean_depth_baseline = after
        .mean_depth_baseline
        .as_ref()
        .map(|t| t.unscaled.abs_rel);
    let mut page = HtmlReport::new(
        "DeepFusion: metric depth from one camera and a speed signal",
        "A simulated street that the embedded network has never seen, by a camera and in a light of its own: zero-shot, and after learning on \
         its first part from images, speed and yaw rate, without any depth label",
    )
    .facts(&[
        ("Abs Rel zero-shot", &number(before.unscaled.abs_rel)),
        ("after learning", &number(after.unscaled.abs_rel)),
        ("mean-depth baseline", &mean_depth_baseline.map_or("-".into(), number)),
        ("scale (1 is metric)", &number(after.scale.median)),
        ("first image to depth", &format!("{first_ms:.0} ms")),
        ("time", &clock(demo.start.elapsed().as_secs_f64())),
    ])
    .section("Zero-shot");
    page = first.add_to(page, "its depth in metres")?;
    page = first.add_truth_to(page)?;
    page = first.add_cloud_to(page)?;
    if let Some(path) = overlay {
        let picture = deepfusion_data::load_rgb(path)?;
        let caption = "3D targets: boxes with distance, followed over time";
        page = page.picture(caption, &picture, PictureFormat::Png)?;
    }
    page = page.section("After learning here").paragraph(
        "What is learned is the metre. So little video alone may also let the sky come nearer and soften edges; simulated depth beside it, as \
         `deepfusion adapt` learns, holds edges but needs more steps.",
    );
    page = second.add_to(page, "its depth in metres after learning")?;
    page = second.add_error_to(page, "error_learned", "Relative error after learning")?;
    page = page
        .section("Accuracy on the part of the street that was not learned from")
        .paragraph(page::PROTOCOL);
    page = run_report::accuracy(page, learned);
    run_report::training(page, &demo.model())?
        .section("Again")
        .command(&run_report::command())
        .write(html)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A short drive, too, has a scan among the frames that are measured on, and none of these is learned from.
    #[test]
    fn every_drive_has_something_to_measure_on() {
        assert_eq!(
            (learned_of(FRAMES), measured_of(FRAMES)),
            (0..120, 125..200)
        );
        for frames in 12..=FRAMES {
            let (learned, mut measured) = (learned_of(frames), measured_of(frames));
            assert!(learned.end < measured.start, "{frames}");
            assert!(
                measured.any(|frame| frame.is_multiple_of(SCAN_EVERY)),
                "{frames}"
            );
        }
    }
}
