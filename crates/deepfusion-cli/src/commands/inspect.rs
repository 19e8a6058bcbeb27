use std::path::{Path, PathBuf};

use deepfusion_data::{
    Dataset, GtKind, Inspection, OpenOptions, ground_truth_names, overlay, save_png,
    write_bag_config,
};
use deepfusion_doctor::inspect;
use deepfusion_hint::count_of;

use crate::cli::{CameraIntrinsics, InspectArgs};
use crate::commands::clocks;
use crate::error::CliError;
use crate::failure::{Reportable, Result};
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion data inspect`.
pub(super) fn run(args: &InspectArgs) -> Result<()> {
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
        // Nothing is written of a part.
        return Err(CliError::Unreadable {
            path: args.path.clone(),
            unreadable: inspection.unreadable.len(),
            recordings: inspection.unreadable.len() + inspection.drives.len(),
            hint: first.error.remedy(),
        }
        .into());
    }
    // First of all, since it may be refused: what is printed then stands as it was read.
    let written = if args.write_config {
        write_config(args, &options)?
    } else {
        Vec::new()
    };
    print(&inspection, args.json)?;
    for file in written {
        say(&format!("{} written", file.display()));
    }
    if args.overlay {
        let folder = output::run_folder(args.out.as_deref(), "inspect")?;
        let pictures = write_overlays(&args.path, &options, &folder)?;
        say(&format!(
            "{} in {}",
            count_of(pictures, "picture"),
            folder.display()
        ));
    }
    Ok(())
}

fn print(inspection: &Inspection, json: bool) -> Result<()> {
    if json {
        output::print_json(inspection)
    } else {
        output::print(&inspection.to_string())
    }
}

/// The files beside the bags, written.
fn write_config(args: &InspectArgs, options: &OpenOptions) -> Result<Vec<PathBuf>> {
    use deepfusion_data::Error;
    write_bag_config(&args.path, options, args.overwrite).map_err(|error| match error {
        Error::Exists { path } => CliError::Exists {
            path,
            remedy: "it is this bag's already; --overwrite rewrites it and keeps its keys",
        }
        .into(),
        other => other.into(),
    })
}

/// A picture for every frame with ground truth; how many.
fn write_overlays(path: &Path, options: &OpenOptions, folder: &Path) -> Result<usize> {
    let datasets = Dataset::open(path, options)?;
    let names = ground_truth_names(&datasets);
    let total = names.iter().map(Vec::len).sum();
    let (mut done, mut written) = (0, 0);
    let mut progress = Progress::new("drawing");
    for (dataset, names) in datasets.iter().zip(&names) {
        for (&frame, name) in dataset.selected().iter().zip(names) {
            if let Some(depth) = dataset.ground_truth(frame, GtKind::Z)? {
                let picture = overlay(&dataset.load_image(frame)?, &depth)?;
                save_png(&picture, &picture_path(folder, name)?)?;
                written += 1;
            }
            done += 1;
            progress.set(done, total);
        }
    }
    if written == 0 {
        return Err(deepfusion_data::Error::NoScans {
            path: path.to_owned(),
            frames: total,
        }
        .into());
    }
    Ok(written)
}

/// `<folder>/<name>.png`, where the name may hold the drive's folder.
fn picture_path(folder: &Path, name: &str) -> Result<PathBuf> {
    let path = folder.join(format!("{name}.png"));
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|e| deepfusion_data::Error::file(parent, e))?;
    }
    Ok(path)
}
