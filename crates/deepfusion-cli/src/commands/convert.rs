use std::path::{Path, PathBuf};

use deepfusion_data::{Converted, Dataset, OpenOptions, convert_to_bag, convert_to_kitti};
use deepfusion_hint::count_of;

use super::clocks;
use super::recordings::open_recordings;
use super::warnings;
use crate::cli::{CameraIntrinsics, ConvertArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::interrupt;
use crate::output;
use crate::progress::{Progress, say};

/// What was made, for scripts.
#[derive(serde::Serialize)]
struct Made<'a> {
    written: &'a [PathBuf],
    frames: usize,
    /// Whole seconds by which all times are later than the input's.
    moved_s: i64,
}

/// `deepfusion data convert`.
pub(super) fn run(args: &ConvertArgs) -> Result<()> {
    warnings::warn_of_hfov(args.hfov);
    let ends_in = |ending: &str| has_ending(&args.out, ending);
    // Otherwise a folder of that name would be made, which is not what the user meant.
    if ends_in("mcap") || ends_in("db3") {
        let path = args.out.clone();
        return Err(CliError::NoRos2Writer { path }.into());
    }
    let input = std::slice::from_ref(&args.input);
    let mut options = OpenOptions {
        camera: args.camera,
        intrinsics: args.intrinsics.map(CameraIntrinsics::numbers),
        hfov_deg: args.hfov,
        topics: args.topics.clone(),
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds(args.clock_offset, input, &options)?;
    let datasets = open_recordings(input, &options)?;
    if ends_in("bag") && datasets.len() != 1 {
        let drives = datasets.len();
        let input = args.input.clone();
        return Err(CliError::SeveralDrives { input, drives }.into());
    }
    // Loading the first frame decodes its video, with a program that Ctrl-C ends as well. So signals are caught only afterwards: until then they
    // end this program at once. If something exists at the output's path, that is reported without decoding first.
    if matches!(deepfusion_fs::in_the_way(&args.out), Ok(None)) {
        for dataset in datasets.iter().filter(|d| !d.frames().is_empty()) {
            dataset.load_image(0)?;
        }
    }
    interrupt::catch("stopping after the current frames");
    let mut progress = Progress::new("converting");
    let mut report = |done, total| {
        progress.set(done, total);
        interrupt::flow()
    };
    let written = match datasets.as_slice() {
        [dataset] if ends_in("bag") => {
            convert_to_bag(dataset, &args.out, args.compression, &mut report)?
        }
        _ => convert_to_kitti(&datasets, &args.out, &mut report)?,
    };
    drop(progress);
    datasets.iter().for_each(warn_of_missing);
    let Converted { paths, moved_s } = written;
    if moved_s > 0 {
        tracing::warn!(
            "{}: some times are not after the beginning of 1970, which neither layout can represent: all times are written \
             {moved_s} s later",
            args.input.display()
        );
    }
    let frames: usize = datasets.iter().map(|d| d.frames().len()).sum();
    if args.json {
        return output::print_json(&Made {
            written: &paths,
            frames,
            moved_s,
        });
    }
    say(&format!("{} written", count_of(frames, "frame")));
    for path in &paths {
        output::print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}

fn has_ending(path: &Path, ending: &str) -> bool {
    let found = path.extension();
    found.is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Warns about times and speeds that the recording lacks and that were therefore not written.
fn warn_of_missing(dataset: &Dataset) {
    let timed = dataset.frames().iter().any(|f| f.time_s.is_some());
    let missing = match (timed, dataset.track().is_some()) {
        (true, true) => return,
        (true, false) => "no speeds",
        (false, true) => "no times",
        (false, false) => "no times and no speeds",
    };
    warnings::warn_once(format!(
        "{}: {missing}, so none were written: it can be used to evaluate and predict, but training needs both",
        dataset.name()
    ));
}
