//! The table: means and spreads over seeds, as text, CSV, Markdown and LaTeX.

use super::rows::Row;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// What one run came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Its row.
    pub row: Row,
    /// Its seed.
    pub seed: u64,
    /// Seconds of training, interruptions left out.
    pub train_seconds: f64,
    /// What `eval` says of it.
    pub report: deepfusion_eval::Report,
}

/// A column of figures.
struct Column {
    name: &'static str,
    value: fn(&RunResult) -> Option<f64>,
    digits: usize,
}

const COLUMNS: [Column; 8] = [
    Column {
        name: "abs_rel",
        value: |r| Some(r.report.unscaled.abs_rel),
        digits: 3,
    },
    Column {
        name: "rmse",
        value: |r| Some(r.report.unscaled.rmse),
        digits: 2,
    },
    Column {
        name: "a1",
        value: |r| Some(r.report.unscaled.a1),
        digits: 3,
    },
    Column {
        name: "abs_rel_scaled",
        value: |r| Some(r.report.median_scaled.abs_rel),
        digits: 3,
    },
    Column {
        name: "scale_median",
        value: |r| Some(r.report.scale.median),
        digits: 3,
    },
    Column {
        name: "abs_rel_static",
        value: |r| r.report.still.map(|m| m.abs_rel),
        digits: 3,
    },
    Column {
        name: "abs_rel_moving",
        value: |r| r.report.moving.map(|m| m.abs_rel),
        digits: 3,
    },
    Column {
        name: "train_min",
        value: |r| Some(r.train_seconds / 60.0),
        digits: 1,
    },
];

/// A figure over the seeds of a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// The standard deviation between seeds (n − 1); absent for one seed.
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
    /// What is on.
    #[serde(flatten)]
    pub row: Row,
    /// The row's name.
    pub name: String,
    /// Seeds that are done.
    pub seeds: usize,
    /// The figures by name, in the columns' order; absent where no run has one.
    #[serde(serialize_with = "by_name")]
    pub figures: Vec<(&'static str, Option<Spread>)>,
}

/// A map in the columns' order.
fn by_name<S: serde::Serializer>(
    figures: &[(&'static str, Option<Spread>)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(figures.iter().map(|(name, figure)| (name, figure)))
}

/// The rows of `rows` that have a run, with what their runs came to.
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

/// The columns that some row has a figure for.
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

/// For people at a terminal.
pub fn text(table: &[TableRow]) -> String {
    let columns = shown(table);
    let mut out = format!(
        "{:5}{:7}{:6}{:16}{:>6}",
        "HCE", "speed", "flow", "frames", "seeds"
    );
    for i in &columns {
        let _ = write!(out, "{:>16}", COLUMNS[*i].name);
    }
    out.push('\n');
    let mark = |on: bool| if on { "x" } else { "·" };
    for line in table {
        let row = line.row;
        let _ = write!(
            out,
            "{:5}{:7}{:6}{:16}{:>6}",
            mark(row.hce),
            mark(row.speed),
            mark(row.flow),
            views(row),
            line.seeds
        );
        for i in &columns {
            let _ = write!(out, "{:>16}", cell(line, *i, " ± "));
        }
        out.push('\n');
    }
    out
}

/// For a spreadsheet: mean and standard deviation in columns of their own, every digit.
pub fn csv(table: &[TableRow]) -> String {
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

/// For a README.
pub fn markdown(table: &[TableRow]) -> String {
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

/// For a paper: a `tabular` that needs amssymb's check mark.
pub fn latex(table: &[TableRow]) -> String {
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
    fn the_spread_is_that_between_seeds() {
        let one = Spread::of(&[0.25]).unwrap();
        assert_eq!((one.mean, one.std), (0.25, None));
        let three = Spread::of(&[1.0, 2.0, 3.0]).unwrap();
        assert_eq!((three.mean, three.std), (2.0, Some(1.0)));
        assert_eq!(three.text(1, " ± "), "2.0 ± 1.0");
        assert_eq!(Spread::of(&[]), None);
    }
}
