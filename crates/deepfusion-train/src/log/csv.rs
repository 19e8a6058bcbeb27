use crate::{Error, LossTerms};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// `log.csv`: one line per record, `split` is "train" or "validation".
#[derive(Debug)]
pub struct CsvLog {
    file: File,
    path: PathBuf,
}

/// The columns after the loss terms.
const EXTRA: &str = "learning_rate,scale_ratio,images_per_second,selection";

/// The content of a line of the log.
#[derive(Debug, Clone, Copy)]
pub struct CsvRecord<'a> {
    /// After this step.
    pub step: usize,
    /// The loss.
    pub losses: &'a LossTerms,
    /// The learning rate; 0 for a validation.
    pub learning_rate: f64,
    /// Measured over predicted displacement, as in [`crate::TrainEvent::Step`].
    pub scale_ratio: f64,
    /// Images per second; 0 for a validation.
    pub images_per_second: f64,
    /// The value that selects `best`, of a validation; `None` for a training step.
    pub selection: Option<f64>,
}

fn header() -> String {
    let terms: Vec<_> = LossTerms::default()
        .named()
        .iter()
        .map(|(n, _)| *n)
        .collect();
    format!("step,split,{},{EXTRA}", terms.join(","))
}

/// A line of a log that another version may have begun, rearranged into the current columns. Missing values are empty.
fn rearranged(columns: &str, line: &str) -> String {
    let values: HashMap<&str, &str> = columns.split(',').zip(line.split(',')).collect();
    let header = header();
    let of = |name| values.get(name).copied().unwrap_or_default();
    header.split(',').map(of).collect::<Vec<_>>().join(",")
}

impl CsvLog {
    /// Opens the log. Drops records after `step`, which an interrupted run wrote after its last checkpoint.
    ///
    /// # Errors
    /// [`Error::Model`].
    pub fn open(path: &Path, step: usize) -> Result<Self, Error> {
        let io = |action| move |e| Error::io(path, action, e);
        let mut kept = vec![header()];
        if step > 0 && path.exists() {
            let file = File::open(path).map_err(io("read"))?;
            let mut lines = BufReader::new(file).lines();
            let columns = lines.next().transpose().map_err(io("read"))?;
            let columns = columns.unwrap_or_default();
            for line in lines {
                let line = line.map_err(io("read"))?;
                let of = line.split(',').next().and_then(|s| s.parse::<usize>().ok());
                if of.is_some_and(|of| of <= step) {
                    kept.push(rearranged(&columns, &line));
                }
            }
        }
        deepfusion_fs::write(path, kept.join("\n") + "\n").map_err(io("write"))?;
        let file = OpenOptions::new().append(true).open(path);
        Ok(Self {
            file: file.map_err(io("write"))?,
            path: path.to_owned(),
        })
    }

    /// Appends a record.
    ///
    /// # Errors
    /// [`Error::Model`].
    pub fn write(&mut self, record: &CsvRecord<'_>) -> Result<(), Error> {
        let terms: Vec<_> = record
            .losses
            .named()
            .iter()
            .map(|(_, v)| format!("{v:.9}"))
            .collect();
        let (split, selection) = match record.selection {
            Some(value) => ("validation", format!("{value:.9}")),
            None => ("train", String::new()),
        };
        let line = format!(
            "{},{split},{},{:e},{:.6},{:.3},{selection}",
            record.step,
            terms.join(","),
            record.learning_rate,
            record.scale_ratio,
            record.images_per_second
        );
        writeln!(self.file, "{line}").map_err(|e| Error::io(&self.path, "write", e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(losses: &LossTerms, step: usize, selection: Option<f64>) -> CsvRecord<'_> {
        CsvRecord {
            step,
            losses,
            learning_rate: 1e-4,
            scale_ratio: 1.0,
            images_per_second: 2.0,
            selection,
        }
    }

    #[test]
    fn validation_rows_have_the_value_that_best_is_chosen_by() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let mut log = CsvLog::open(&path, 0).unwrap();
        let nothing = LossTerms::default();
        log.write(&record(&nothing, 1, None)).unwrap();
        log.write(&record(&nothing, 1, Some(0.125))).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(lines[0].last(), Some(&"selection"));
        assert!(lines.iter().all(|l| l.len() == lines[0].len()), "{text}");
        let ends: Vec<_> = lines.iter().map(|l| (l[1], l[l.len() - 1])).collect();
        assert_eq!(ends[1..], [("train", ""), ("validation", "0.125000000")]);
    }

    #[test]
    fn a_resumed_log_continues_at_the_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let write = |from: usize, steps: std::ops::RangeInclusive<usize>| {
            let mut log = CsvLog::open(&path, from).unwrap();
            for step in steps {
                log.write(&record(&LossTerms::default(), step, None))
                    .unwrap();
            }
        };
        write(0, 1..=7);
        write(4, 5..=6);
        let text = std::fs::read_to_string(&path).unwrap();
        let steps: Vec<_> = text.lines().skip(1).map(|l| &l[..1]).collect();
        assert_eq!(steps, ["1", "2", "3", "4", "5", "6"]);
        assert!(text.starts_with("step,split,total,reprojection"), "{text}");
    }

    /// If a log of an earlier version lacks a column, its lines stay and the missing values are empty.
    #[test]
    fn an_older_log_is_rearranged_into_the_current_columns() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        std::fs::write(&path, "step,total,split\n1,0.5,train\n2,0.4,train\n").unwrap();
        drop(CsvLog::open(&path, 1).unwrap());
        let text = std::fs::read_to_string(&path).unwrap();
        let commas = header().matches(',').count();
        let expected = format!("{}\n1,train,0.5{}\n", header(), ",".repeat(commas - 2));
        assert_eq!(text, expected);
    }
}
