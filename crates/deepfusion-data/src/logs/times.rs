//! Reads a table's column of times.

use super::clock::{TimeUnit, seconds};
use super::table::{Column, Table};
use crate::dataset_toml::FolderConfig;
use crate::{ColumnsProblem, DataWarning, ExpectedCell, Result, TableProblem, TimesWarning};
use deepfusion_logs::parse_date;

pub(super) const TIMES: [&str; 5] = ["time", "timestamp", "t", "stamp", "timestamps"];

/// The form of a column's times.
enum TimeStyle {
    Numbers(TimeUnit),
    /// Dates, all with a time zone or all without.
    Dates {
        zoned: bool,
    },
}

impl TimeStyle {
    fn nanoseconds(&self, word: &str) -> Option<i64> {
        match self {
            Self::Numbers(unit) => unit.nanoseconds(word),
            Self::Dates { zoned } => {
                let (ns, says_zone) = parse_date(word)?;
                (says_zone == *zoned).then_some(ns)
            }
        }
    }
}

/// The form of a column's times: dates if the first is one, otherwise numbers. Warns about dates without a time zone.
fn style_of(
    table: &Table,
    column: &Column,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
    name: &str,
) -> Result<TimeStyle> {
    if let Some((_, zoned)) = table.words(column).next().and_then(parse_date) {
        if !zoned {
            let log = name.to_owned();
            warnings.push(TimesWarning::NoZone { log }.into());
        }
        return Ok(TimeStyle::Dates { zoned });
    }
    let unit = match (&column.unit, &config.time_unit) {
        (Some(unit), _) | (None, Some(unit)) => TimeUnit::named(unit),
        (None, None) => {
            let unit = TimeUnit::of_numbers(&table.numbers(column)?);
            if let Some(unit) = unit {
                let no_unit = TimesWarning::NoUnit {
                    table: name.to_owned(),
                    column: column.header.clone(),
                    unit: unit.symbol(),
                };
                warnings.push(no_unit.into());
            }
            unit
        }
    };
    unit.map(TimeStyle::Numbers).ok_or_else(|| {
        table.lacks(ColumnsProblem::NoTimeUnit {
            column: column.header.clone(),
        })
    })
}

/// The table's times in nanoseconds, which must increase; repeated times give a warning. `example`: a header that such a table may have.
pub(crate) fn times(
    table: &Table,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
    name: &str,
    example: &'static str,
) -> Result<Vec<i64>> {
    let column = table.require(&TIMES, example)?;
    if table.len() == 0 {
        return Err(table.lacks(ColumnsProblem::NoRows));
    }
    let style = style_of(table, column, config, warnings, name)?;
    let mut all: Vec<i64> = Vec::with_capacity(table.len());
    let mut repeated = Vec::new();
    for (row, word) in table.words(column).enumerate() {
        let ns = style.nanoseconds(word);
        let not_a_time = || TableProblem::not(ExpectedCell::Time, word);
        let ns = ns.ok_or_else(|| table.bad(row, column, not_a_time()))?;
        match all.last() {
            Some(last) if ns < *last => {
                let problem = TableProblem::Earlier {
                    text: word.to_owned(),
                    seconds: seconds(*last, ns),
                };
                return Err(table.bad(row, column, problem));
            }
            Some(last) if ns == *last => repeated.push(table.line(row)),
            _ => {}
        }
        all.push(ns);
    }
    if let Some(first) = repeated.first() {
        let repeated = TimesWarning::Repeated {
            table: name.to_owned(),
            rows: repeated.len(),
            line: *first,
        };
        warnings.push(repeated.into());
    }
    Ok(all)
}
