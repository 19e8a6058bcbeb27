use std::path::Path;

use deepfusion_data::{Dataset, OpenOptions, export_gt};
use deepfusion_hint::count_of;
use deepfusion_jobs::evaluation::{check_used, expected_frames};
use deepfusion_jobs::recordings::read_split;

use super::clocks;
use super::recordings::open_recordings;
use super::warnings;
use crate::cli::ExportGtArgs;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// What was made, for scripts.
#[derive(serde::Serialize)]
struct Made<'a> {
    file: &'a Path,
    frames: usize,
    /// Number of the split's frames, if a split was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<usize>,
}

/// `deepfusion data export-gt`.
pub(super) fn run(args: &ExportGtArgs) -> Result<()> {
    output::require_new(&args.out, args.overwrite)?;
    let mut options = OpenOptions {
        camera: args.camera,
        split: read_split(args.split.as_deref())?,
        topics: args.topics.clone(),
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds(args.clock_offset, &args.paths, &options)?;
    let datasets = open_recordings(&args.paths, &options)?;
    let expected = expected_frames(&options, &datasets, args.strict)?;
    let kind = args.gt_depth;
    if args.strict {
        // Checked before the file is written: a part of the frames must not be mistaken for all of them.
        let with_truth = |d: &Dataset| {
            d.selected()
                .iter()
                .filter(|f| d.has_ground_truth(**f, kind))
                .count()
        };
        check_used(
            &options,
            &datasets,
            datasets.iter().map(with_truth).sum(),
            true,
        )?;
    }
    let mut progress = Progress::new("reading scans");
    let written = export_gt(&datasets, kind, &args.out, &mut |done, total| {
        progress.set(done, total)
    })?;
    drop(progress);
    if let Some(shortfall) = check_used(&options, &datasets, written, args.strict)? {
        warnings::warn_once(shortfall.to_string());
    }
    if args.json {
        return output::print_json(&Made {
            file: &args.out,
            frames: written,
            expected,
        });
    }
    say(&match expected {
        Some(expected) => format!(
            "{written} of the split's {} with ground truth",
            count_of(expected, "frame")
        ),
        None => format!("{} with ground truth", count_of(written, "frame")),
    });
    output::print(&format!("{}\n", args.out.display()))
}
