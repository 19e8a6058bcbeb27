use std::path::Path;

use crate::error::{Error, LogProblem, Result};

/// The learning curve of a run: its `log.csv`, column by column. Any columns besides `step` and `split` are accepted, so
/// that logs of other versions are shown too.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearningLog {
    columns: Vec<String>,
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    step: f64,
    validation: bool,
    /// Values by column, in the order of the columns; NaN if a cell is empty or does not parse.
    values: Vec<f64>,
}

impl LearningLog {
    /// Reads a log.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read, [`Error::Log`] if it is not a log.
    pub fn read(path: &Path) -> Result<Self> {
        let text =
            std::fs::read_to_string(path).map_err(|e| deepfusion_images::Error::file(path, e))?;
        Self::parse(&text).map_err(|problem| Error::Log {
            path: path.to_owned(),
            problem,
        })
    }

    fn parse(text: &str) -> std::result::Result<Self, LogProblem> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .from_reader(text.as_bytes());
        let header = reader.headers()?.clone();
        let place = |name: &'static str| {
            let found = header.iter().position(|c| c == name);
            found.ok_or(LogProblem::NoColumn(name))
        };
        let (step, split) = (place("step")?, place("split")?);
        let columns: Vec<usize> = (0..header.len())
            .filter(|c| *c != step && *c != split)
            .collect();
        let mut rows = Vec::new();
        let mut broken = None;
        for record in reader.records() {
            let record = record?;
            if let Some(line) = broken {
                return Err(LogProblem::Line(line));
            }
            let number = |c: usize| record.get(c).and_then(|cell| cell.parse::<f64>().ok());
            match (number(step), record.get(split)) {
                (Some(step), Some(split)) if record.len() == header.len() => rows.push(Row {
                    step,
                    validation: split == "validation",
                    values: columns
                        .iter()
                        .map(|c| number(*c).unwrap_or(f64::NAN))
                        .collect(),
                }),
                // Accepted in the last line: the run may have been killed while writing it.
                _ => broken = Some(record.position().map_or(0, csv::Position::line)),
            }
        }
        let name = |c: &usize| header.get(*c).unwrap_or_default().to_owned();
        Ok(Self {
            columns: columns.iter().map(name).collect(),
            rows,
        })
    }

    /// Names of the columns.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// The last step.
    #[must_use]
    pub fn steps(&self) -> f64 {
        self.rows.iter().map(|r| r.step).fold(0.0, f64::max)
    }

    /// Step and value of a column, of the training lines or of the validations. Empty if there is no such column.
    #[must_use]
    pub fn series(&self, column: &str, validation: bool) -> Vec<(f64, f64)> {
        let Some(place) = self.columns.iter().position(|c| c == column) else {
            return Vec::new();
        };
        let rows = self.rows.iter().filter(|r| r.validation == validation);
        rows.map(|r| (r.step, r.values[place])).collect()
    }

    /// Whether a column is zero or empty throughout.
    pub(crate) fn is_zero(&self, column: &str) -> bool {
        let some = |(_, v): &(f64, f64)| v.is_finite() && *v != 0.0;
        ![true, false]
            .iter()
            .any(|split| self.series(column, *split).iter().any(some))
    }
}

/// A noisy curve as the means of about `most` stretches of equal length.
pub(crate) fn smoothed(points: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    let length = points.len().div_ceil(most.max(1)).max(1);
    let mean = |stretch: &[(f64, f64)]| {
        let n = stretch.len() as f64;
        let (x, y) = stretch
            .iter()
            .fold((0.0, 0.0), |(x, y), p| (x + p.0, y + p.1));
        (x / n, y / n)
    };
    points.chunks(length).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "step,split,total,flow,learning_rate\n1,train,0.5,0.0,1e-4\n2,train,0.4,0.0,1e-4\n\
                       2,validation,0.45,0.0,0e0\n";

    #[test]
    fn columns_are_found_by_name() {
        let log = LearningLog::parse(LOG).unwrap();
        assert_eq!(log.columns(), ["total", "flow", "learning_rate"]);
        assert_eq!(log.series("total", false), [(1.0, 0.5), (2.0, 0.4)]);
        assert_eq!(log.series("total", true), [(2.0, 0.45)]);
        assert!(log.series("no such", false).is_empty());
        assert!(log.is_zero("flow") && !log.is_zero("total"));
        assert_eq!(log.steps(), 2.0);
    }

    #[test]
    fn only_the_last_line_may_be_cut_off() {
        let cut = format!("{LOG}3,train,0.");
        assert_eq!(
            LearningLog::parse(&cut).unwrap(),
            LearningLog::parse(LOG).unwrap()
        );
        let error = LearningLog::parse(&format!("{cut}\n4,train,0.1,0,1\n")).unwrap_err();
        assert!(matches!(error, LogProblem::Line(5)), "{error}");
        assert_eq!(error.to_string(), "line 5: no step, or too few cells");
        let error = LearningLog::parse("a,b\n1,2\n").unwrap_err();
        assert!(matches!(error, LogProblem::NoColumn("step")), "{error}");
        assert_eq!(error.to_string(), "no column `step`");
        assert!(LearningLog::parse("").is_err());
    }

    #[test]
    fn cells_that_are_not_numbers_leave_gaps() {
        let log = LearningLog::parse("step,split,total\n1,train,\n2,train,x\n").unwrap();
        assert!(log.series("total", false).iter().all(|p| p.1.is_nan()));
        assert!(log.is_zero("total"));
    }

    #[test]
    fn smoothing_keeps_the_mean() {
        let points: Vec<_> = (0..100).map(|i| (f64::from(i), f64::from(i % 2))).collect();
        let smooth = smoothed(&points, 10);
        assert_eq!(smooth.len(), 10);
        assert!(smooth.iter().all(|p| p.1 == 0.5));
        assert_eq!(smoothed(&points[..3], 10), &points[..3]);
        assert!(smoothed(&[], 10).is_empty());
    }
}
