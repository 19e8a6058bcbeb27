use anyhow::Result;
use deepfusion_data::export_gt;

use super::evaluate::open_datasets;
use crate::cli::ExportGtArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion data export-gt`.
pub fn run(args: &ExportGtArgs) -> Result<()> {
    if args.out.exists() && !args.overwrite {
        return Err(CliError::Exists {
            path: args.out.clone(),
            remedy: "pass --overwrite to replace it, or choose another name",
        }
        .into());
    }
    let datasets = open_datasets(&args.paths, args.split.as_deref(), args.camera)?;
    let mut progress = Progress::new("reading scans");
    let written = export_gt(
        &datasets,
        args.gt_depth.kind(),
        &args.out,
        &mut |done, total| progress.set(done, total),
    )?;
    drop(progress);
    say(&format!("{written} frames with ground truth"));
    output::print(&format!("{}\n", args.out.display()))
}
