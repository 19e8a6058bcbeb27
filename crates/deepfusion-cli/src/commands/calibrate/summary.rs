//! A calibration as lines.

use std::fmt::Write as _;

use deepfusion_calibrate::LensModel;

use super::Report;

/// Pictures left out that are named; the others are counted.
const NAMED: usize = 6;

/// Everything that was found.
pub(super) fn text(report: &Report) -> String {
    let mut text = String::new();
    for (name, what) in rows(report) {
        let _ = writeln!(text, "{name:14}{what}");
    }
    text
}

/// A name and a value each; the name is empty where the value goes on.
pub(super) fn rows(report: &Report) -> Vec<(String, String)> {
    let found = report.calibration;
    let (k, errors) = (&found.intrinsics, &found.standard_errors);
    let mut rows = Vec::new();
    let mut row = |name: &str, what: String| rows.push((name.to_owned(), what));
    let lens = match found.model {
        LensModel::BrownConrady => "Brown-Conrady",
        LensModel::Fisheye => "fisheye (Kannala-Brandt)",
    };
    row("camera", format!("{}x{} pixels, {lens}", k.width, k.height));
    for (name, value, error) in [
        ("fx", k.fx, errors.fx),
        ("fy", k.fy, errors.fy),
        ("cx", k.cx, errors.cx),
        ("cy", k.cy, errors.cy),
    ] {
        row(name, format!("{value:.3} ± {error:.3} px"));
    }
    let lens = found.coefficients.iter().zip(&errors.coefficients);
    for (name, (value, error)) in report.coefficient_names.iter().zip(lens) {
        row(name, format!("{value:.5} ± {error:.5}"));
    }
    row(
        "field of view",
        match found.hfov_deg {
            Some(degrees) => format!("{degrees:.1} degrees from left to right"),
            None => "unknown: the lens model ends before the image does".into(),
        },
    );
    let corners = found.used() * report.board.corners();
    row(
        "error",
        format!(
            "{:.3} px, root mean square of {corners} corners",
            found.rms_px
        ),
    );
    row("views", views(report));
    let disagree = found.views.iter().filter(|v| !v.used);
    let disagree = disagree.map(|v| match v.rms_px {
        Some(px) => (v.name.as_str(), format!("{px:.2} px off")),
        None => (v.name.as_str(), "disagrees with the others".into()),
    });
    let without = report
        .left_out
        .iter()
        .map(|l| (l.name.as_str(), l.why.to_string()));
    let out: Vec<_> = disagree.chain(without).collect();
    for (name, why) in out.iter().take(NAMED) {
        row("", format!("left out: {name} ({why})"));
    }
    if out.len() > NAMED {
        row("", format!("left out: {} more", out.len() - NAMED));
    }
    let tilts = found.views.iter().filter(|v| v.used);
    let tilts = tilts.filter_map(|v| v.tilt_deg);
    let (least, most) = tilts.fold((f64::MAX, 0.0f64), |(a, b), t| (a.min(t), b.max(t)));
    row("tilt", format!("{least:.0} to {most:.0} degrees"));
    row(
        "coverage",
        format!(
            "{:.0} % of the image; corners in each ninth of it:",
            100.0 * found.coverage.share
        ),
    );
    for [left, middle, right] in found.coverage.ninths {
        row("", format!("{left:6}{middle:6}{right:6}"));
    }
    row("written", report.written.display().to_string());
    rows
}

fn views(report: &Report) -> String {
    let used = report.calibration.used();
    let mut text = format!("{used} used of {} looked at", report.looked_at);
    if report.not_picked > 0 {
        let _ = write!(
            text,
            "; {} more show the board as one of these does",
            report.not_picked
        );
    }
    text
}
