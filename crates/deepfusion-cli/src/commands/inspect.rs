use std::path::PathBuf;

use deepfusion_data::{Inspection, OpenOptions, write_bag_config, write_overlays};
use deepfusion_doctor::inspect;
use deepfusion_geometry::Intrinsics;
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::looks_of_another_size;

use crate::cli::{CameraIntrinsics, InspectArgs};
use crate::commands::{clocks, warnings};
use crate::error::CliError;
use crate::failure::{Reportable, Result};
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion data inspect`.
pub(super) fn run(args: &InspectArgs) -> Result<()> {
    warnings::warn_of_hfov(args.hfov);
    let mut options = OpenOptions {
        intrinsics: args.intrinsics.map(CameraIntrinsics::numbers),
        hfov_deg: args.hfov,
        topics: args.topics.clone(),
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds_of(args.clock_offset, &args.path, &options)?;
    let inspection = inspect(&args.path, &options)?;
    if let Some(first) = inspection.unreadable.first() {
        print(&inspection, args.json)?;
        // If some recordings are unreadable, nothing is written for the others.
        return Err(CliError::Unreadable {
            path: args.path.clone(),
            unreadable: inspection.unreadable.len(),
            recordings: inspection.unreadable.len() + inspection.drives.len(),
            hint: first.error.hint_in_options(),
        }
        .into());
    }
    // Before printing, since writing may be refused.
    let written = if args.write_config {
        write_config(args, &options)?
    } else {
        Vec::new()
    };
    print(&inspection, args.json)?;
    if let Some(camera) = camera(&inspection).filter(looks_of_another_size) {
        let path = args.path.display();
        tracing::warn!("{path}: {}", warnings::of_another_size(&camera));
    }
    for file in written {
        say(&format!("{} written", file.display()));
    }
    if args.overlay {
        let folder = output::run_folder(args.out.as_deref(), "inspect")?;
        let mut progress = Progress::new("drawing");
        let mut drawn = |done, total| progress.set(done, total);
        let pictures = write_overlays(&args.path, &options, &folder, &mut drawn)?;
        drop(progress);
        say(&format!(
            "{} in {}",
            count_of(pictures, "picture"),
            folder.display()
        ));
    }
    Ok(())
}

/// The camera of the images, if there are any.
fn camera(inspection: &Inspection) -> Option<Intrinsics> {
    let (k, [width, height]) = inspection.intrinsics.zip(inspection.size)?;
    let numbers = [k.fx, k.fy, k.cx, k.cy];
    Some(Intrinsics::from_numbers(numbers, (width, height)))
}

fn print(inspection: &Inspection, json: bool) -> Result<()> {
    if json {
        output::print_json(inspection)
    } else {
        output::print(&inspection.to_string())
    }
}

/// Writes the files beside the bags and returns their paths.
fn write_config(args: &InspectArgs, options: &OpenOptions) -> Result<Vec<PathBuf>> {
    use deepfusion_data::Error;
    write_bag_config(&args.path, options, args.overwrite).map_err(|error| match error {
        Error::Exists { path } => CliError::Exists {
            path,
            hint: "edit it, or rewrite it with --overwrite, which keeps its keys",
        }
        .into(),
        other => other.into(),
    })
}
