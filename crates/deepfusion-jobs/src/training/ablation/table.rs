//! The table: means and standard deviations over seeds, as text, CSV, Markdown and LaTeX.

use super::rows::Row;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// The result of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Its row.
    pub row: Row,
    /// Its seed.
    pub seed: u64,
    /// Seconds of training, without interruptions.
    pub train_seconds: f64,
    /// Number of parameters of the depth network, which is what runs after training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameters: Option<u64>,
    /// Its evaluation.
    pub report: deepfusion_eval::Report,
}

/// A column of the table.
struct Column {
    name: &'static str,
    value: fn(&RunResult) -> Option<f64>,
    digits: usize,
}

impl Column {
    const fn new(name: &'static str, digits: usize, value: fn(&RunResult) -> Option<f64>) -> Self {
        Self {
            name,
            value,
            digits,
        }
    }
}

/// The usual seven metrics on unscaled depth, then those that separate scale from shape, then the cost.
const COLUMNS: [Column; 13] = [
    Column::new("abs_rel", 3, |r| Some(r.report.unscaled.abs_rel)),
    Column::new("sq_rel", 3, |r| Some(r.report.unscaled.sq_rel)),
    Column::new("rmse", 3, |r| Some(r.report.unscaled.rmse)),
    Column::new("rmse_log", 3, |r| Some(r.report.unscaled.rmse_log)),
    Column::new("a1", 3, |r| Some(r.report.unscaled.a1)),
    Column::new("a2", 3, |r| Some(r.report.unscaled.a2)),
    Column::new("a3", 3, |r| Some(r.report.unscaled.a3)),
    Column::new("abs_rel_scaled", 3, |r| {
        Some(r.report.median_scaled.abs_rel)
    }),
    Column::new("scale_median", 3, |r| Some(r.report.scale.median)),
    Column::new("abs_rel_static", 3, |r| r.report.still.map(|m| m.abs_rel)),
    Column::new("abs_rel_moving", 3, |r| r.report.moving.map(|m| m.abs_rel)),
    Column::new("train_hours", 2, |r| Some(r.train_seconds / 3600.0)),
    Column::new("parameters_m", 2, |r| r.parameters.map(|n| n as f64 / 1e6)),
];

/// Mean and standard deviation of a figure over the seeds of a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// The standard deviation over seeds (n − 1); absent for one seed.
    pub std: Option<f64>,
}

impl Spread {
    fn of(values: &[f64]) -> Option<Self> {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        (!values.is_empty()).then(|| Self {
            mean,
            std: (values.len() > 1).then(|| (squares / (n - 1.0)).sqrt()),
        })
    }

    fn text(self, digits: usize, plus_minus: &str) -> String {
        match self.std {
            Some(std) => format!("{:.digits$}{plus_minus}{std:.digits$}", self.mean),
            None => format!("{:.digits$}", self.mean),
        }
    }
}

/// A row with its figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableRow {
    /// Which parts are on.
    #[serde(flatten)]
    pub row: Row,
    /// The row's name.
    pub name: String,
    /// Number of seeds that are done.
    pub seeds: usize,
    /// The figures by name, in the columns' order; absent if no run has the figure.
    #[serde(serialize_with = "by_name")]
    pub figures: Vec<(&'static str, Option<Spread>)>,
}

/// Serialises the figures as a map in the columns' order.
fn by_name<S: serde::Serializer>(
    figures: &[(&'static str, Option<Spread>)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(figures.iter().map(|(name, figure)| (name, figure)))
}

/// The rows that have a run, with their results.
#[must_use]
pub fn table(rows: &[Row], results: &[RunResult]) -> Vec<TableRow> {
    let of_row = |row: &Row| {
        let runs: Vec<_> = results.iter().filter(|r| r.row == *row).collect();
        let figure = |column: &Column| {
            let values: Vec<f64> = runs.iter().filter_map(|run| (column.value)(run)).collect();
            (column.name, Spread::of(&values))
        };
        (!runs.is_empty()).then(|| TableRow {
            row: *row,
            name: row.name(),
            seeds: runs.len(),
            figures: COLUMNS.iter().map(figure).collect(),
        })
    };
    rows.iter().filter_map(of_row).collect()
}

/// The columns for which some row has a figure.
fn shown(table: &[TableRow]) -> Vec<usize> {
    let has = |i: &usize| table.iter().any(|row| row.figures[*i].1.is_some());
    (0..COLUMNS.len()).filter(has).collect()
}

fn cell(row: &TableRow, column: usize, plus_minus: &str) -> String {
    let figure = row.figures[column].1;
    figure.map_or("–".into(), |f| f.text(COLUMNS[column].digits, plus_minus))
}

fn views(row: Row) -> &'static str {
    if row.minimum {
        "three, minimum"
    } else {
        "two, both ways"
    }
}

/// The table for a terminal.
#[must_use]
pub fn text(table: &[TableRow]) -> String {
    let mark = |on: bool| if on { "x" } else { "·" }.to_owned();
    let mut lines = vec![
        ["HCE", "speed", "flow", "frames", "seeds"]
            .map(str::to_owned)
            .to_vec(),
    ];
    lines.extend(table.iter().map(|line| {
        let row = line.row;
        vec![
            mark(row.hce),
            mark(row.speed),
            mark(row.flow),
            views(row).into(),
            line.seeds.to_string(),
        ]
    }));
    for column in shown(table) {
        lines[0].push(COLUMNS[column].name.into());
        for (cells, row) in lines[1..].iter_mut().zip(table) {
            cells.push(cell(row, column, " ± "));
        }
    }
    aligned(&lines, 4)
}

/// Aligns cells in columns two spaces apart: the first `left` columns to the left, the others to the right.
fn aligned(lines: &[Vec<String>], left: usize) -> String {
    let width = |i: usize| lines.iter().map(|cells| cells[i].chars().count()).max();
    let mut out = String::new();
    for cells in lines {
        let mut text = String::new();
        for (i, cell) in cells.iter().enumerate() {
            let width = width(i).unwrap_or(0);
            let _ = if i < left {
                write!(text, "{cell:<width$}  ")
            } else {
                write!(text, "{cell:>width$}  ")
            };
        }
        out.push_str(text.trim_end());
        out.push('\n');
    }
    out
}

/// The table for a spreadsheet: mean and standard deviation in separate columns, with all digits.
pub(super) fn csv(table: &[TableRow]) -> String {
    let mut out = String::from("row,hce,speed,flow,minimum,seeds");
    for column in &COLUMNS {
        let _ = write!(out, ",{0},{0}_std", column.name);
    }
    out.push('\n');
    for line in table {
        let row = line.row;
        let _ = write!(
            out,
            "{},{},{},{},{},{}",
            line.name, row.hce, row.speed, row.flow, row.minimum, line.seeds
        );
        for (_, figure) in &line.figures {
            let number = |v: Option<f64>| v.map(|v| v.to_string()).unwrap_or_default();
            let (mean, std) = (figure.map(|f| f.mean), figure.and_then(|f| f.std));
            let _ = write!(out, ",{},{}", number(mean), number(std));
        }
        out.push('\n');
    }
    out
}

/// The table for a README.
pub(super) fn markdown(table: &[TableRow]) -> String {
    let columns = shown(table);
    let mut out = String::from("| HCE | speed | flow | frames | seeds |");
    for i in &columns {
        let _ = write!(out, " {} |", COLUMNS[*i].name);
    }
    out.push('\n');
    out.push_str(&"|---".repeat(5 + columns.len()));
    out.push_str("|\n");
    let mark = |on: bool| if on { "✓" } else { "" };
    for line in table {
        let row = line.row;
        let _ = write!(
            out,
            "| {} | {} | {} | {} | {} |",
            mark(row.hce),
            mark(row.speed),
            mark(row.flow),
            views(row),
            line.seeds
        );
        for i in &columns {
            let _ = write!(out, " {} |", cell(line, *i, " ± "));
        }
        out.push('\n');
    }
    out
}

/// The table for a paper: a `tabular` that needs amssymb's check mark.
pub(super) fn latex(table: &[TableRow]) -> String {
    let columns = shown(table);
    let mut out = format!(
        "\\begin{{tabular}}{{cccl{}}}\n\\hline\n",
        "r".repeat(columns.len())
    );
    out.push_str("HCE & Speed & Flow & Frames");
    for i in &columns {
        let _ = write!(out, " & {}", COLUMNS[*i].name.replace('_', "\\_"));
    }
    out.push_str(" \\\\\n\\hline\n");
    let mark = |on: bool| if on { "\\checkmark" } else { "" };
    for line in table {
        let row = line.row;
        let _ = write!(
            out,
            "{} & {} & {} & {}",
            mark(row.hce),
            mark(row.speed),
            mark(row.flow),
            views(row)
        );
        for i in &columns {
            let _ = write!(out, " & ${}$", cell(line, *i, " \\pm ").replace('–', "-"));
        }
        out.push_str(" \\\\\n");
    }
    out.push_str("\\hline\n\\end{tabular}\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_the_deviation_between_seeds() {
        let one = Spread::of(&[0.25]).unwrap();
        assert_eq!((one.mean, one.std), (0.25, None));
        let three = Spread::of(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!((three.mean, three.std), (2.0, Some(1.0)));
        assert_eq!(three.text(1, " ± "), "2.0 ± 1.0");
        assert_eq!(Spread::of(&[]), None);
    }

    fn result(seed: u64, abs_rel: f64) -> RunResult {
        let metrics = serde_json::json!({
            "abs_rel": abs_rel, "sq_rel": 1.5, "rmse": 5.25, "rmse_log": 0.3, "a1": 0.7, "a2": 0.9, "a3": 0.95
        });
        let report = serde_json::json!({
            "n": 4,
            "protocol": {"crop": "none", "cap_m": 80.0, "min_m": 0.001, "gt": "z"},
            "unscaled": metrics,
            "median_scaled": metrics,
            "scale": {"median": 1.0, "std_rel": 0.0, "bias": 0.0, "bias_ci95": null},
            "ranges": [],
        });
        RunResult {
            row: Row::table_3()[0],
            seed,
            train_seconds: 1800.0,
            parameters: Some(14_330_000),
            report: serde_json::from_value(report).unwrap(),
        }
    }

    /// As in the paper's Table 3: seven metrics, hours and parameters.
    #[test]
    fn a_row_has_every_metric_with_its_cost() {
        let table = table(&Row::table_3(), &[result(0, 0.25), result(1, 0.27)]);
        let text = text(&table);
        let lines: Vec<Vec<&str>> = text
            .lines()
            .map(|l| {
                l.split("  ")
                    .map(str::trim)
                    .filter(|c| !c.is_empty())
                    .collect()
            })
            .collect();
        assert_eq!(
            lines[0],
            [
                "HCE",
                "speed",
                "flow",
                "frames",
                "seeds",
                "abs_rel",
                "sq_rel",
                "rmse",
                "rmse_log",
                "a1",
                "a2",
                "a3",
                "abs_rel_scaled",
                "scale_median",
                "train_hours",
                "parameters_m"
            ],
            "{text}"
        );
        assert_eq!(lines[1][5..7], ["0.260 ± 0.014", "1.500 ± 0.000"], "{text}");
        assert_eq!(lines[1][14..], ["0.50 ± 0.00", "14.33 ± 0.00"], "{text}");
        assert_eq!(lines.len(), 2, "rows without a run are left out: {text}");
        for name in [
            "sq_rel",
            "rmse_log",
            "a2",
            "a3",
            "train_hours",
            "parameters_m",
        ] {
            assert!(
                csv(&table).contains(&format!(",{name},{name}_std")),
                "{name}"
            );
        }
    }
}
