//! `deepfusion eval`: depth compared with ground truth, or evaluated without it.

mod from_model;
mod verdict;

use std::path::Path;

use deepfusion_eval::{ArraySet, Crop, Prediction, Report};
use deepfusion_jobs::evaluation::{
    Evaluated, EvaluationOutcome, EvaluationPage, MeasuredDepth, baseline_from_arrays,
    evaluate_arrays, shown_of_arrays,
};

use crate::cli::{EvalArgs, PredKind};
use crate::commands::command_line;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion eval`.
pub(super) fn run(args: &EvalArgs) -> Result<()> {
    for file in [&args.report, &args.points_out].into_iter().flatten() {
        output::require_new(file, args.overwrite)?;
    }
    let found = match (&args.pred, args.pred_kind, &args.gt) {
        (Some(predictions), Some(kind), Some(truth)) => EvaluationOutcome {
            report: Some(from_arrays(args, predictions, kind, truth)?),
            ..EvaluationOutcome::default()
        },
        _ => from_model::outcome(args)?,
    };
    if args.json {
        return output::print_json(&found);
    }
    output::print(&found.to_string())
}

fn from_arrays(
    args: &EvalArgs,
    predictions: &Path,
    kind: PredKind,
    truth: &Path,
) -> Result<Report> {
    let mut predicted = ArraySet::open(predictions)?;
    let mut known = ArraySet::open(truth)?;
    let baseline = args
        .trivial
        .as_deref()
        .map(baseline_from_arrays)
        .transpose()?;
    let protocol = args.protocol(Crop::None);
    let mut progress = Progress::new("evaluating");
    let of_kind = |grid| match kind {
        PredKind::Depth => Prediction::Depth(grid),
        PredKind::Disparity => Prediction::Disparity(grid),
    };
    let evaluated = evaluate_arrays(
        (&mut predicted, &of_kind),
        &mut known,
        &protocol,
        baseline,
        &mut |done, total| progress.set(done, total),
    )?;
    write_points(args, &evaluated)?;
    if let Some(path) = &args.report {
        let shown = shown_of_arrays((&mut predicted, &of_kind), &mut known, &evaluated)?;
        let page = EvaluationPage {
            source: MeasuredDepth::Arrays {
                predictions,
                truth,
                protocol: &protocol,
                command: &command_line::typed_again(),
            },
            evaluated: &evaluated,
            shown: &shown,
            reliability: None,
            verdict: None,
        };
        page.compose()?.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(evaluated.report)
}

/// Writes the drawn points, with `--points-out`.
fn write_points(args: &EvalArgs, evaluated: &Evaluated) -> Result<()> {
    let Some(path) = &args.points_out else {
        return Ok(());
    };
    evaluated.write_points(path)?;
    say(&format!("points  {}", path.display()));
    Ok(())
}
