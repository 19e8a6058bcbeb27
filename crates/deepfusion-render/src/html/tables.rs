use std::fmt::Write as _;

use deepfusion_eval::{Crop, IntervalRow, Intervals, Metrics, Report, Sharpness};

use super::escape;

/// A table: the first column is text, the others are numbers.
pub(super) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    table_of_class("plain", header, rows)
}

/// The mark of a table cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mark {
    /// No mark.
    #[default]
    None,
    /// The best of its column: bold.
    Best,
    /// The second best: underlined.
    Second,
    /// Implausible: grey, with a sign in its row.
    Doubtful,
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cell {
    /// Its text.
    pub text: String,
    /// Its mark.
    pub mark: Mark,
    /// Whether it is text, aligned on the left, and not a number.
    pub words: bool,
}

impl Cell {
    /// A cell without a mark.
    #[must_use]
    pub fn plain(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }
}

/// A table with marks.
pub(super) fn marked(header: &[&str], rows: &[Vec<Cell>]) -> String {
    let mut out = String::from(r#"<div class="scroll"><table class="dense"><thead><tr>"#);
    for (c, cell) in header.iter().enumerate() {
        let words = rows.iter().all(|r| r.get(c).is_some_and(|cell| cell.words));
        let class = if words { r#" class="words""# } else { "" };
        // Writing to a String cannot fail, here and below.
        let _ = write!(out, "<th{class}>{}</th>", escape(cell));
    }
    out.push_str("</tr></thead><tbody>");
    for row in rows {
        out.push_str("<tr>");
        for cell in row {
            let mark = match cell.mark {
                Mark::None => "",
                Mark::Best => "best",
                Mark::Second => "second",
                Mark::Doubtful => "doubtful",
            };
            let words = if cell.words { "words" } else { "" };
            let class = match format!("{words} {mark}").trim() {
                "" => String::new(),
                classes => format!(r#" class="{classes}""#),
            };
            let _ = write!(out, "<td{class}>{}</td>", escape(&cell.text));
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>");
    out
}

fn table_of_class(class: &str, header: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = format!(r#"<div class="scroll"><table class="{class}"><thead><tr>"#);
    for cell in header {
        // Writing to a String cannot fail, here and below.
        let _ = write!(out, "<th>{}</th>", escape(cell));
    }
    out.push_str("</tr></thead><tbody>");
    for row in rows {
        out.push_str("<tr>");
        for cell in row {
            let _ = write!(out, "<td>{}</td>", escape(cell));
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>");
    out
}

/// All results of an evaluation, as tables and sentences.
pub(super) fn evaluation(report: &Report) -> String {
    let mut out = table_of_class(
        "metrics",
        &[
            "",
            "Abs Rel ↓",
            "Sq Rel ↓",
            "RMSE ↓",
            "RMSE log ↓",
            "δ < 1.25 ↑",
            "δ < 1.25² ↑",
            "δ < 1.25³ ↑",
        ],
        &metric_rows(report),
    );
    let crop = match report.protocol.crop {
        Crop::None => "the whole image",
        Crop::Garg => "Garg's crop",
    };
    let gt = report.protocol.gt.meaning();
    let _ = write!(
        out,
        "<p class=\"note\">Means over {} image{}: {crop}, {} to {} m, ground truth: {gt}.{}</p>",
        report.n,
        if report.n == 1 { "" } else { "s" },
        report.protocol.min_m,
        report.protocol.cap_m,
        if report.mean_depth_baseline.is_some() {
            " The mean-depth baseline predicts each pixel's mean depth over the training scans, without looking at the image."
        } else {
            ""
        },
    );
    out.push_str(&scale_table(report));
    let rows: Vec<Vec<String>> = report
        .ranges
        .iter()
        .map(|bin| {
            vec![
                format!("{} to {} m", bin.from_m, bin.to_m),
                bin.n.to_string(),
                number(bin.abs_rel),
                number(bin.rmse),
            ]
        })
        .collect();
    out.push_str(&table(
        &["range (unscaled)", "pixels", "Abs Rel", "RMSE, m"],
        &rows,
    ));
    if !report.skipped.is_empty() {
        let _ = write!(
            out,
            "<p class=\"note\">Without ground truth and therefore skipped: {}.</p>",
            escape(&report.skipped.join(", "))
        );
    }
    out
}

fn metric_rows(report: &Report) -> Vec<Vec<String>> {
    let row = |label: &str, metrics: &Metrics| {
        let mut row = vec![label.to_owned()];
        row.extend(metrics.to_array().iter().map(|v| format!("{v:.3}")));
        row
    };
    let mut rows = vec![
        row("unscaled (metric)", &report.unscaled),
        row("median-scaled", &report.median_scaled),
    ];
    if let Some(fixed) = &report.fixed_scaled {
        rows.push(row(&format!("scaled by {}", fixed.factor), &fixed.metrics));
    }
    // Without dynamic pixels, the static row would only repeat the first.
    if let Some(metrics) = &report.moving {
        if let Some(still) = &report.still {
            rows.push(row("static (labelled)", still));
        }
        let plural = if report.moving_images == 1 { "" } else { "s" };
        let label = format!("moving, {} image{plural}", report.moving_images);
        rows.push(row(&label, metrics));
    }
    if let Some(mean_depth_baseline) = &report.mean_depth_baseline {
        rows.push(row("mean-depth baseline", &mean_depth_baseline.unscaled));
        rows.push(row(
            "mean-depth baseline, median-scaled",
            &mean_depth_baseline.median_scaled,
        ));
    }
    for scenario in &report.scenarios {
        let label = format!("{}, scale {:.3}", scenario.name, scenario.scale.median);
        rows.push(row(&label, &scenario.unscaled));
    }
    rows
}

/// Metrics that need boundaries in the truth have no row without them.
fn sharp_rows(sharpness: &Sharpness) -> Vec<Vec<String>> {
    let px = |v: f64| format!("{v:.2} px");
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    let row = |label: &str, value: Option<String>| value.map(|v| vec![label.to_owned(), v]);
    [
        row(
            "depth boundaries: distance to the true ones (accuracy)",
            sharpness.boundary_accuracy_px.map(px),
        ),
        row(
            "depth boundaries: the same, with missed ones counted as 10 px (completeness)",
            sharpness.boundary_completeness_px.map(px),
        ),
        row(
            "flying pixels: at depth jumps, with a depth between the two sides",
            sharpness.flying_share.map(percent),
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Coverage and width of the intervals of each level.
fn interval_rows(intervals: &Intervals) -> Vec<Vec<String>> {
    let whose = if intervals.in_sample {
        ", of the pixels they were calibrated on"
    } else if intervals.calibrated {
        ""
    } else {
        ", not calibrated"
    };
    let row = |row: &IntervalRow| {
        let percent = |v: f64| format!("{:.1} %", 100.0 * v);
        vec![
            format!(
                "{:.0} % intervals: pixels within, and width over depth{whose}",
                100.0 * row.level
            ),
            format!("{}, {}", percent(row.coverage), percent(row.width_rel)),
        ]
    };
    intervals.levels.iter().map(row).collect()
}

fn scale_table(report: &Report) -> String {
    let scale = &report.scale;
    let interval = scale.bias_ci95.map_or_else(
        || "–".to_owned(),
        |[low, high]| format!("{low:+.3} to {high:+.3}"),
    );
    let mut rows = vec![
        vec![
            "scale: median of median(gt) / median(prediction)".into(),
            format!("{:.3}", scale.median),
        ],
        vec![
            "its relative spread over images".into(),
            format!("{:.3}", scale.std_rel),
        ],
        vec![
            "bias: mean of ln(median(prediction) / median(gt))".into(),
            format!("{:+.3}", scale.bias),
        ],
        vec!["its 95 % interval".into(), interval],
    ];
    if let Some(rate) = report.hole_rate {
        let moving = report.hole_rate_moving.map_or_else(String::new, |rate| {
            format!("; {:.2} % of dynamic pixels", 100.0 * rate)
        });
        rows.push(vec![
            format!(
                "holes: nearer than {} m, predicted at the far limit or more than 3 times too far",
                report.protocol.cap_m * 0.5
            ),
            format!("{:.2} %{moving}", 100.0 * rate),
        ]);
    }
    rows.extend(report.sharpness.iter().flat_map(sharp_rows));
    rows.extend(report.intervals.iter().flat_map(interval_rows));
    if let Some(rate) = report.missing_rate {
        rows.push(vec![
            "ground truth without prediction".into(),
            format!("{:.2} %", 100.0 * rate),
        ]);
    }
    table(&["scale", ""], &rows)
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"))
}
