//! `deepfusion calibrate`: a camera from pictures of a checkerboard.

mod page;
mod summary;

use deepfusion_calibrate::{Board, Calibration};
use deepfusion_data::camera_info_yaml;
use deepfusion_hint::count_of;
use deepfusion_jobs::board::{LeftOut, SearchProgress, find_views};
use serde::Serialize;

use crate::cli::CalibrateArgs;
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// What is reported of a calibration.
#[derive(Debug, Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    calibration: &'a Calibration,
    /// What makes it less sure than it could be.
    warnings: Vec<String>,
    /// Names of `coefficients`.
    coefficient_names: &'a [&'a str],
    board: Board,
    /// Pictures and frames of videos that were looked at.
    looked_at: usize,
    /// Those that show no whole board.
    left_out: &'a [LeftOut],
    /// Frames of videos that show the board where another does already, or less sharply.
    not_picked: usize,
    written: &'a std::path::Path,
}

/// `deepfusion calibrate`.
pub(super) fn run(args: &CalibrateArgs) -> Result<()> {
    let board = Board::new(
        args.board.width as usize,
        args.board.height as usize,
        args.square,
    )?;
    if args.out.exists() && !args.overwrite {
        return Err(CliError::Exists {
            path: args.out.clone(),
            remedy: "choose another --out, or give --overwrite to replace it",
        }
        .into());
    }
    for file in std::iter::once(&args.out).chain(&args.report) {
        output::require_folder_of(file)?;
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
    let warnings = seen.warnings(&found, &lens);
    let name = output::name_of(args.inputs[0].as_ref());
    let yaml = camera_info_yaml(&name, &found.intrinsics, &lens, &comments(&found, &board));
    output::write(&args.out, yaml)?;
    let report = Report {
        calibration: &found,
        warnings: warnings.iter().map(ToString::to_string).collect(),
        coefficient_names: found.model.coefficients(),
        board,
        looked_at: seen.looked_at,
        left_out: &seen.left_out,
        not_picked: seen.not_picked,
        written: &args.out,
    };
    if let Some(path) = &args.report {
        page::write(path, &report, &seen.views)?;
        say(&format!("report    {}", path.display()));
    }
    for warning in &report.warnings {
        tracing::warn!("{warning}");
    }
    if args.json {
        return output::print_json(&report);
    }
    output::print(&summary::text(&report))?;
    say(&format!(
        "use it: deepfusion predict --calib {} IMAGES --out DIR, or as calibration.yaml in a drive's folder",
        args.out.display()
    ));
    Ok(())
}

/// What the file says of itself.
fn comments(found: &Calibration, board: &Board) -> Vec<String> {
    let errors = &found.standard_errors;
    vec![
        format!(
            "deepfusion calibrate: {} of a board of {}x{} inner corners, squares of {} m; error {:.3} px (root mean square)",
            count_of(found.used(), "view"),
            board.columns,
            board.rows,
            board.square_m,
            found.rms_px
        ),
        format!(
            "standard errors in px: fx {:.3}, fy {:.3}, cx {:.3}, cy {:.3}",
            errors.fx, errors.fy, errors.cx, errors.cy
        ),
    ]
}
