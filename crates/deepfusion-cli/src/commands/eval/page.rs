//! The page of an evaluation: what was found, on which frames best and worst, how it was measured.

use deepfusion_data::GtKind;
use deepfusion_eval::compare::SavedEvaluation;
use deepfusion_eval::{Crop, Protocol};
use deepfusion_jobs::evaluation::{ChosenImage, Evaluated};
use deepfusion_render::{HtmlReport, ShownFrame};

use crate::cli::EvalArgs;
use crate::commands::run_report;
use crate::failure::Result;
use crate::output;

/// The page but for the training of the model.
pub(super) fn of(
    args: &EvalArgs,
    name: &str,
    evaluated: &Evaluated,
    shown: &[(ChosenImage, ShownFrame)],
    how: &[(String, String)],
) -> Result<HtmlReport> {
    let report = &evaluated.report;
    let number = |v: f64| format!("{v:.3}");
    let mean_depth_baseline = report
        .mean_depth_baseline
        .as_ref()
        .map(|t| t.unscaled.abs_rel);
    let names: Vec<_> = args.data.iter().map(|p| output::name_of(p)).collect();
    let on = if names.is_empty() {
        String::new()
    } else {
        format!(" on {}", names.join(", "))
    };
    let images = match report.expected {
        Some(expected) => format!("{} of the split's {expected}", report.n),
        None => report.n.to_string(),
    };
    let page = HtmlReport::new(name, format!("Depth measured{on}"))
        .facts(&[
            ("Abs Rel, unscaled", &number(report.unscaled.abs_rel)),
            (
                "Abs Rel, mean-depth baseline",
                &mean_depth_baseline.map_or("–".into(), number),
            ),
            ("scale (1 is metric)", &number(report.scale.median)),
            (
                "within 25 %",
                &format!("{:.1} %", 100.0 * report.unscaled.a1),
            ),
            ("images", &images),
        ])
        .section("Accuracy");
    let page = run_report::accuracy(page, evaluated);
    let page = run_report::frames(page, shown)?;
    Ok(page
        .section("How it was measured")
        .properties(how)
        .command(&run_report::command()))
}

/// How a network was measured, row by row.
pub(super) fn how_a_model_was_measured(
    args: &EvalArgs,
    protocol: &Protocol,
    saved: &SavedEvaluation,
) -> Vec<(String, String)> {
    let m = &saved.measured;
    let data = args.data.iter().map(|p| p.display().to_string());
    let truth = match &args.gt {
        Some(path) => path.display().to_string(),
        None if args.gt_depth == GtKind::Annotated => "KITTI's annotated depth".into(),
        None => "the recordings' scans".into(),
    };
    let mut rows = vec![
        ("recordings", data.collect::<Vec<_>>().join(", ")),
        ("ground truth", truth),
        ("camera", m.camera.clone()),
        ("checkpoint", saved.model.checkpoint.clone()),
        ("its SHA-256", saved.model.sha256.clone()),
        ("engine", m.engine.clone()),
        (
            "seen in training",
            match m.held_out {
                Some(true) => "no",
                Some(false) => "yes",
                None => "not known",
            }
            .into(),
        ),
        (
            "correction for the focal length",
            if m.focal_correction { "on" } else { "off" }.into(),
        ),
        ("program", m.program.clone()),
        ("time (UTC)", m.time.clone()),
    ];
    if let Some(how) = m.post_process {
        rows.push(("post-processing", how.explained().to_owned()));
    }
    if let Some(split) = &args.split {
        rows.insert(1, ("split", split.display().to_string()));
    }
    let mut rows: Vec<_> = rows.into_iter().map(|(a, b)| (a.to_owned(), b)).collect();
    rows.extend(protocol_rows(protocol));
    if let Some(digest) = &saved.report.truth_sha256 {
        rows.push(("SHA-256 of the ground truth".to_owned(), digest.clone()));
    }
    rows
}

/// What the protocol compares.
pub(super) fn protocol_rows(protocol: &Protocol) -> [(String, String); 2] {
    let crop = match protocol.crop {
        Crop::None => "the whole image",
        Crop::Garg => "Garg's crop",
    };
    [
        ("compared".to_owned(), crop.to_owned()),
        (
            "range".to_owned(),
            format!("{} to {} m", protocol.min_m, protocol.cap_m),
        ),
    ]
}
