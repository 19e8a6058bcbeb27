//! `deepfusion view --rerun`: a file for the rerun viewer, if the program was built with it.

use std::path::Path;

use crate::cli::ViewArgs;
#[cfg(not(feature = "rerun"))]
use crate::error::CliError;
use crate::failure::Result;

/// Writes the folder's frames to `file`.
#[cfg(feature = "rerun")]
pub(super) fn run(args: &ViewArgs, file: &Path) -> Result<()> {
    use crate::progress::{Progress, say};
    use crate::{interrupt, output};

    output::require_new(file, args.overwrite)?;
    let folder = deepfusion_view::Folder::open(&args.folder)?;
    interrupt::catch("stopping; nothing is written");
    let mut bar = Progress::new("writing");
    let report = deepfusion_view::write_rerun(
        &folder,
        file,
        |done, total| bar.set(done, total),
        interrupt::asked,
    );
    drop(bar);
    let report = report?;
    warn(&report.problems);
    let frames = deepfusion_hint::count_of(report.frames, "frame");
    say(&format!(
        "{}: {frames}; open it with `rerun {}` (version {})",
        file.display(),
        file.display(),
        deepfusion_view::rerun_version()
    ));
    Ok(())
}

/// Without the feature: an error whose hint says how to get it.
#[cfg(not(feature = "rerun"))]
pub(super) fn run(_args: &ViewArgs, _file: &Path) -> Result<()> {
    Err(CliError::NoRerun.into())
}

/// Warns of the frames' problems, up to a readable number; the file has them all.
#[cfg(feature = "rerun")]
fn warn(problems: &[(String, deepfusion_view::FrameProblem)]) {
    const SHOWN: usize = 20;
    for (frame, problem) in problems.iter().take(SHOWN) {
        tracing::warn!("{frame}: {problem}");
    }
    if problems.len() > SHOWN {
        let more = problems.len() - SHOWN;
        tracing::warn!("and {more} more, at the entity `frames` of the file");
    }
}
