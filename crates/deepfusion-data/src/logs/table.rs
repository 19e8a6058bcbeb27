//! Reads comma-separated tables with a header, so that every error names file, line and column.

use crate::{ColumnsProblem, Error, ExpectedCell, Quantity, Result, TableProblem};
use std::path::{Path, PathBuf};

/// A table's header and rows.
pub(crate) struct Table {
    path: PathBuf,
    columns: Vec<Column>,
    rows: Vec<(u64, csv::StringRecord)>,
}

/// A column's header, split into name and unit: `speed_kmh`, `speed [km/h]` and `speed (km/h)` are equivalent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    /// The header as written in the file.
    pub(crate) header: String,
    /// The name in lower case, without its unit.
    pub(crate) name: String,
    /// The unit, as written.
    pub(crate) unit: Option<String>,
    index: usize,
}

impl Table {
    /// Reads a table with values separated by commas, semicolons or tabs, depending on its header.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Row`] if the number of values in a row differs from that in the header.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        let first = bytes.split(|b| *b == b'\n').next().unwrap_or(&[]);
        let delimiter = *b";\t".iter().find(|d| first.contains(d)).unwrap_or(&b',');
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .trim(csv::Trim::All)
            .from_reader(&bytes[..]);
        let refused = |error: csv::Error| Error::Row {
            path: path.to_owned(),
            line: error.position().map_or(1, csv::Position::line),
            problem: match error.kind() {
                csv::ErrorKind::UnequalLengths {
                    expected_len, len, ..
                } => TableProblem::Length {
                    found: *len,
                    header: *expected_len,
                },
                csv::ErrorKind::Utf8 { .. } => TableProblem::NotText,
                _ => TableProblem::Csv(error),
            },
        };
        let header = reader.headers().map_err(refused)?.clone();
        let columns = header.iter().enumerate().map(|(i, h)| Column::parse(i, h));
        let mut table = Self {
            path: path.to_owned(),
            columns: columns.collect(),
            rows: Vec::new(),
        };
        for row in reader.into_records() {
            let row = row.map_err(refused)?;
            let line = row.position().map_or(0, |at| {
                // A record's position is before the empty lines above it.
                let from = bytes.get(at.byte() as usize..).unwrap_or(&[]);
                let empty = from.iter().take_while(|b| b"\r\n".contains(b));
                at.line() + empty.filter(|b| **b == b'\n').count() as u64
            });
            table.rows.push((line, row));
        }
        Ok(table)
    }

    /// The first column with one of these names.
    pub(crate) fn column(&self, names: &[&str]) -> Option<&Column> {
        let named = |c: &&Column| names.contains(&c.name.as_str());
        self.columns.iter().find(named)
    }

    /// [`Self::column`], or an error that lists the existing columns.
    pub(crate) fn require(&self, names: &[&str], example: &'static str) -> Result<&Column> {
        self.column(names).ok_or_else(|| {
            self.lacks(if self.columns.is_empty() {
                ColumnsProblem::Empty { example }
            } else {
                ColumnsProblem::NoColumn {
                    wanted: names[0].to_owned(),
                    found: self.columns.iter().map(|c| c.header.clone()).collect(),
                    example,
                }
            })
        })
    }

    /// An error about the table's columns.
    pub(crate) fn lacks(&self, problem: ColumnsProblem) -> Error {
        Error::Columns {
            path: self.path.clone(),
            problem,
        }
    }

    /// An error about a column with an unknown or missing unit.
    pub(crate) fn no_unit(&self, quantity: Quantity, column: &Column, unit: Option<&str>) -> Error {
        self.lacks(match unit {
            Some(unit) => ColumnsProblem::UnknownUnit {
                quantity,
                unit: unit.to_owned(),
            },
            None => ColumnsProblem::NoUnit {
                quantity,
                column: column.header.clone(),
            },
        })
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The cells of a column, row by row.
    pub(crate) fn words<'a>(&'a self, column: &'a Column) -> impl Iterator<Item = &'a str> {
        let word = |row: &'a (u64, csv::StringRecord)| row.1.get(column.index).unwrap_or("");
        self.rows.iter().map(word)
    }

    /// The finite numbers of a column.
    ///
    /// # Errors
    /// [`Error::Table`] for a value that is empty, not a number, or not finite.
    pub(crate) fn numbers(&self, column: &Column) -> Result<Vec<f64>> {
        let words = self.words(column).enumerate();
        let number = |(row, word): (usize, &str)| {
            let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
            value
                .ok_or_else(|| self.bad(row, column, TableProblem::not(ExpectedCell::Number, word)))
        };
        words.map(number).collect()
    }

    /// An error about a value; rows are counted from 0.
    pub(crate) fn bad(&self, row: usize, column: &Column, problem: TableProblem) -> Error {
        Error::Table {
            path: self.path.clone(),
            line: self.line(row),
            column: column.header.clone(),
            problem,
        }
    }

    /// The line of a row, counted from 1.
    pub(crate) fn line(&self, row: usize) -> u64 {
        self.rows.get(row).map_or(0, |r| r.0)
    }
}

impl Column {
    fn parse(index: usize, header: &str) -> Self {
        let text = header.trim().trim_start_matches('#').trim();
        let (name, unit) = match text.split_once(['[', '(']) {
            Some((name, unit)) => (name, Some(unit.trim_end_matches([']', ')']))),
            None => with_suffix(text),
        };
        Self {
            header: header.to_owned(),
            name: name.trim().to_lowercase().replace([' ', '-'], "_"),
            unit: unit
                .map(|u| u.trim().to_lowercase())
                .filter(|u| !u.is_empty()),
            index,
        }
    }
}

/// Splits a name from the unit after its last underscore.
fn with_suffix(text: &str) -> (&str, Option<&str>) {
    const UNITS: [&str; 21] = [
        "s", "sec", "ms", "us", "ns", "mps", "kmh", "kph", "mph", "radps", "dps", "degps", "mps2",
        "g", "m", "mm", "rad", "deg", "hz", "m/s", "km/h",
    ];
    match text.rsplit_once('_') {
        Some((name, unit)) if UNITS.contains(&unit.to_lowercase().as_str()) => (name, Some(unit)),
        _ => (text, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Table> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Table::read(file.path())
    }

    #[test]
    fn headers_are_split_into_name_and_unit() {
        for (header, name, unit) in [
            ("speed_kmh", "speed", Some("kmh")),
            ("#timestamp [ns]", "timestamp", Some("ns")),
            (" Speed (km/h)", "speed", Some("km/h")),
            ("yaw_rate", "yaw_rate", None),
            ("yaw_rate_radps", "yaw_rate", Some("radps")),
            ("Yaw Rate [deg/s]", "yaw_rate", Some("deg/s")),
        ] {
            let column = Column::parse(0, header);
            assert_eq!((column.name.as_str(), column.unit.as_deref()), (name, unit));
        }
    }

    #[test]
    fn a_bad_value_is_named_with_file_line_and_column() {
        let table = read("time_s,speed_mps\n0,1\n\n0.1,NaN\n").unwrap();
        let speed = table.column(&["speed"]).unwrap();
        let error = table.numbers(speed).unwrap_err().to_string();
        assert!(
            error.ends_with(":4: column speed_mps: 'NaN' is not a finite number"),
            "{error}"
        );
        let error = table.require(&["yaw_rate"], "x").map(|_| ()).unwrap_err();
        assert!(
            error.to_string().contains("only time_s, speed_mps"),
            "{error}"
        );
        let error = read("a,b\n1,2\n1\n").map(|_| ()).unwrap_err().to_string();
        assert!(
            error.contains(":3:") && error.contains("1 value, but the header has 2"),
            "{error}"
        );
    }

    #[test]
    fn byte_order_marks_semicolons_and_windows_lines_are_read() {
        let table = read("\u{feff}time_s;speed_mps\r\n0;1.5\r\n").unwrap();
        assert_eq!(
            table.numbers(table.column(&["time"]).unwrap()).unwrap(),
            [0.0]
        );
        assert_eq!(
            table.numbers(table.column(&["speed"]).unwrap()).unwrap(),
            [1.5]
        );
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "(.|\n|,){0,80}") {
            if let Ok(table) = read(&text) {
                for column in &table.columns {
                    let _ = table.numbers(column);
                }
            }
        }
    }
}
