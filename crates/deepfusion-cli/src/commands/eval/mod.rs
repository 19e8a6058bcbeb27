//! `deepfusion eval`: depth against ground truth, or judged without it.

mod from_model;
mod page;
mod verdict;

use std::fmt;
use std::path::Path;

use deepfusion_eval::verdict::{ScaleCertificate, Verdict};
use deepfusion_eval::{ArraySet, Crop, Prediction, Report};
use deepfusion_jobs::evaluation::{
    Evaluated, UsedCheckpoint, baseline_from_arrays, evaluate_arrays, shown_of_arrays,
};
use serde::Serialize;

use crate::cli::{EvalArgs, PredKind};
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion eval`.
pub(super) fn run(args: &EvalArgs) -> Result<()> {
    for file in [&args.report, &args.points_out].into_iter().flatten() {
        output::require_folder_of(file)?;
    }
    let found = match (&args.pred, args.pred_kind, &args.gt) {
        (Some(predictions), Some(kind), Some(truth)) => EvalOutcome {
            report: Some(from_arrays(args, predictions, kind, truth)?),
            ..EvalOutcome::default()
        },
        _ => from_model::outcome(args)?,
    };
    if args.json {
        return output::print_json(&found.printed());
    }
    output::print(&found.to_string())
}

/// What was found, as far as the data show it.
#[derive(Default)]
struct EvalOutcome {
    checkpoint: Option<UsedCheckpoint>,
    /// With ground truth.
    report: Option<Report>,
    /// Without it.
    verdict: Option<Verdict>,
}

impl EvalOutcome {
    fn printed(&self) -> Printed<'_> {
        let certificate = self
            .verdict
            .as_ref()
            .and_then(|v| v.scale_certificate.as_ref());
        Printed {
            checkpoint: self.checkpoint.as_ref(),
            report: self.report.as_ref(),
            certificate: certificate.filter(|_| self.report.is_none()),
            verdict: self.verdict.as_ref(),
        }
    }
}

impl fmt::Display for EvalOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(checkpoint) = &self.checkpoint {
            write!(f, "{checkpoint}\n\n")?;
        }
        if let Some(report) = &self.report {
            write!(f, "{report}")?;
        }
        if let Some(verdict) = &self.verdict {
            let between = if self.report.is_some() { "\n" } else { "" };
            write!(f, "{between}{verdict}")?;
        }
        Ok(())
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    checkpoint: Option<&'a UsedCheckpoint>,
    #[serde(flatten)]
    report: Option<&'a Report>,
    /// The certificate where there is nothing else to go by; it is always in `scale_certificate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    certificate: Option<&'a ScaleCertificate>,
    #[serde(flatten)]
    verdict: Option<&'a Verdict>,
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
        let how = [
            ("predictions", predictions.display().to_string()),
            ("ground truth", truth.display().to_string()),
        ];
        let mut how: Vec<_> = how.map(|(a, b)| (a.to_owned(), b)).into();
        how.extend(page::protocol_rows(&protocol));
        let name = output::name_of(predictions);
        page::of(args, &name, &evaluated, &shown, &how)?.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(evaluated.report)
}

/// Writes the drawn points where `--points-out` asks for them.
fn write_points(args: &EvalArgs, evaluated: &Evaluated) -> Result<()> {
    let Some(path) = &args.points_out else {
        return Ok(());
    };
    evaluated.write_points(path)?;
    say(&format!("points  {}", path.display()));
    Ok(())
}
