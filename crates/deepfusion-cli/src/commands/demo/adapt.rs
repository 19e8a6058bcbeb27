//! The demo with the embedded network: its zero-shot depth on a new street, and what training there adds.

use std::path::Path;
use std::time::Instant;

use clap::Parser;
use deepfusion_jobs::ModelFacts;
use deepfusion_jobs::demo::new_street::{NewStreetPage, SplitDrive, StreetResult, recipe, street};
use deepfusion_jobs::training::Start;
use deepfusion_runtime::ModelSource;
use deepfusion_weights::{DEFAULT, Shipped};

use super::{DEMO, Demo, measure};
use crate::cli::PerceiveArgs;
use crate::commands::{command_line, perceive, train};
use crate::failure::Result;
use crate::interrupt;
use crate::progress::say;

/// Arguments of `perceive` alone.
#[derive(Parser)]
struct Typed {
    #[command(flatten)]
    args: PerceiveArgs,
}

/// The demo of an embedded network.
pub(super) fn run(demo: &Demo, network: Box<Shipped>) -> Result<()> {
    say("1/4 simulating a drive along a street that the network has never seen");
    let drive = demo.simulate("street", &street(&demo.settings))?;
    let parts = SplitDrive::of(&drive, &demo.folder)?;

    say(&format!(
        "2/4 depth in metres, a point cloud and 3D targets, from the embedded network `{}` of {}",
        network.card.name, network.card.date
    ));
    let shipped = ModelSource::Packed {
        given: DEFAULT.into(),
        network: network.clone(),
    };
    let mut estimator = demo.estimator(&shipped)?;
    let frame = parts.shown_frame();
    let before = Instant::now();
    let factors = shipped.interval_factors()?;
    let first = demo.predict_frame((&mut estimator, &factors), &parts.all, frame)?;
    let first_ms = 1e3 * before.elapsed().as_secs_f64();
    let (picture, cloud) = (first.write("")?, demo.folder.cloud());
    first.write_cloud(&cloud)?;
    say(&format!(
        "an image became metres in {first_ms:.0} ms\npicture {}\ncloud   {}",
        picture.display(),
        cloud.display()
    ));
    let targets = demo.folder.join("targets");
    let followed = perceive(demo, &drive, &targets);
    // Checked before the error of `perceive`, whose hint for an interrupted run does not apply to the demo.
    interrupt::check(DEMO)?;
    followed?;
    let zero_shot = measure(&mut estimator, &parts.learned, &parts.measured)?;
    say(&format!(
        "abs_rel {:.3} unscaled, from single images, without training here",
        zero_shot.report.unscaled.abs_rel
    ));

    say("3/4 training on the street's first part with images, speed and yaw rate");
    let start = Start::Packed {
        network,
        path: None,
    };
    let config = recipe(
        &demo.settings,
        (estimator.config(), &start),
        (&drive, &parts.learned_split),
        &demo.device,
    )?;
    let adapted = demo.learn(config, |model| {
        start.initialise(model, &demo.device, &mut train::print_start)
    })?;

    say("4/4 evaluating again on the part that was not trained on; pictures and the report");
    let mut estimator = demo.estimator(&adapted)?;
    let learned = measure(&mut estimator, &parts.learned, &parts.measured)?;
    let factors = adapted.interval_factors()?;
    let second = demo.predict_frame((&mut estimator, &factors), &parts.all, frame)?;
    second.write("_learned")?;
    let overlay = first.overlay_in(&targets)?;
    let page = NewStreetPage {
        zero_shot: StreetResult {
            shown: &first,
            evaluated: &zero_shot,
        },
        learned: StreetResult {
            shown: &second,
            evaluated: &learned,
        },
        overlay: overlay.as_deref(),
        first_ms,
        seconds: demo.seconds(),
        run: &demo.folder.model(),
        command: &command_line::typed_again(),
    };
    let html = demo.folder.page();
    page.compose()?.write(&html)?;
    say(&format!("targets deepfusion view {}", targets.display()));
    demo.end(&learned, &html)
}

/// 3D targets of the whole drive, tracked over time, with pictures, by the command `perceive` with its default, the embedded
/// network.
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
