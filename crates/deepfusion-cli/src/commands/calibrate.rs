//! `deepfusion calibrate`: a camera's intrinsics and lens from images of a checkerboard.

use deepfusion_calibrate::Board;
use deepfusion_hint::count_of;
use deepfusion_jobs::board::{SearchProgress, find_views};

use crate::cli::CalibrateArgs;
use crate::commands::command_line;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion calibrate`.
pub(super) fn run(args: &CalibrateArgs) -> Result<()> {
    let board = Board::new(
        args.board.width as usize,
        args.board.height as usize,
        args.square,
    )?;
    for file in std::iter::once(&args.out).chain(&args.report) {
        output::require_new(file, args.overwrite)?;
    }
    let mut progress = Progress::new("looking for the board");
    let seen = find_views(
        &args.inputs,
        &board,
        usize::from(args.frames),
        &mut |so_far| match so_far {
            SearchProgress::Video { file, frames } => {
                say(&format!(
                    "{}: {}",
                    file.display(),
                    count_of(frames, "frame")
                ));
            }
            SearchProgress::Done(done, total) => progress.set(done, total),
        },
    )?;
    drop(progress);
    let (found, lens) = seen.calibrate(&board, args.model())?;
    let report = seen.report(&board, (&found, &lens), &args.out);
    let name = output::name_of(args.inputs[0].as_ref());
    output::write(&args.out, report.yaml(&name))?;
    if let Some(path) = &args.report {
        report.page(&command_line::typed_again())?.write(path)?;
        say(&format!("report    {}", path.display()));
    }
    for warning in &report.warnings {
        tracing::warn!("{warning}");
    }
    if args.json {
        return output::print_json(&report);
    }
    output::print(&report.to_string())?;
    say(&format!(
        "use it with deepfusion predict --calib {} IMAGES --out DIR, or as calibration.yaml in a drive's folder",
        args.out.display()
    ));
    Ok(())
}
