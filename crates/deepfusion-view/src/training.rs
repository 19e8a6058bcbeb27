//! A training run: its learning curve and its panels.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::{ContentProblem, Error, Result};

/// A longer log is thinned to this many rows, about as many as the page has pixels.
const MOST_ROWS: usize = 2000;

/// Whether a folder is a run: it has a log.
pub(crate) fn is_run(folder: &Path) -> bool {
    folder.join("log.csv").is_file()
}

/// Numbers of the log by column; `None` if a row has no finite one.
type Columns = BTreeMap<String, Vec<Option<f64>>>;

/// A run as sent to the page.
#[derive(Debug, Serialize)]
pub(crate) struct TrainingRun {
    /// The columns' names, in the log's order, without those that are zero or empty throughout.
    columns: Vec<String>,
    /// The panels' file names.
    panels: Vec<String>,
    /// The column that counts the steps.
    step_column: String,
    train: Columns,
    validation: Columns,
}

/// The log as columns, and the panels' names. The steps of a long log are thinned evenly; all validations are kept.
pub(crate) fn read(folder: &Path) -> Result<TrainingRun> {
    let path = folder.join("log.csv");
    let failed = |e: csv::Error| Error::content(&path, e);
    // A last line that is still being written has too few fields and is left out.
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_path(&path)
        .map_err(failed)?;
    let header: Vec<String> = reader
        .headers()
        .map_err(failed)?
        .iter()
        .map(str::to_owned)
        .collect();
    let (Some(step), Some(split)) = (
        header.iter().position(|h| h == "step"),
        header.iter().position(|h| h == "split"),
    ) else {
        return Err(Error::content(&path, ContentProblem::NoLog));
    };
    let (mut train, mut validation) = (Vec::new(), Vec::new());
    for row in reader.records() {
        let row = row.map_err(failed)?;
        if row.len() != header.len() {
            continue;
        }
        let numbers: Vec<Option<f64>> = row
            .iter()
            .map(|f| f.parse().ok().filter(|n: &f64| n.is_finite()))
            .collect();
        match row.get(split) {
            Some("train") => train.push(numbers),
            _ => validation.push(numbers),
        }
    }
    let stride = train.len().div_ceil(MOST_ROWS).max(1);
    let last = train.len().saturating_sub(1);
    let kept = train
        .iter()
        .enumerate()
        .filter(|(i, _)| i % stride == 0 || *i == last);
    let train: Vec<&Vec<Option<f64>>> = kept.map(|(_, row)| row).collect();
    let columns = || header.iter().enumerate().filter(move |(i, _)| *i != split);
    let table = |rows: &[&Vec<Option<f64>>]| -> Columns {
        let column = |i: usize| -> Vec<Option<f64>> { rows.iter().map(|r| r[i]).collect() };
        columns()
            .map(|(i, name)| (name.clone(), column(i)))
            .collect()
    };
    let (train, validation) = (table(&train), table(&validation.iter().collect::<Vec<_>>()));
    // As in the report, a term that is switched off has no curve.
    let has_curve = |name: &String| {
        let parts = [&train, &validation].into_iter();
        let numbers = parts.filter_map(|part| part.get(name)).flatten();
        numbers.flatten().any(|number| *number != 0.0)
    };
    let names = columns().map(|(_, name)| name);
    Ok(TrainingRun {
        columns: names.filter(|name| has_curve(name)).cloned().collect(),
        panels: panels(folder),
        step_column: header[step].clone(),
        train,
        validation,
    })
}

/// The panels' file names, in order.
fn panels(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder.join("panels"))
        .into_iter()
        .flatten()
        .flatten();
    let mut names: Vec<String> = files
        .filter_map(|f| f.file_name().into_string().ok())
        .filter(|n| n.ends_with(".png") && !n.starts_with('.'))
        .collect();
    names.sort();
    names
}

/// Path of a panel, if the folder contains it.
pub(crate) fn panel(folder: &Path, name: &str) -> Option<PathBuf> {
    let found = panels(folder).into_iter().find(|n| n == name)?;
    Some(folder.join("panels").join(found))
}
