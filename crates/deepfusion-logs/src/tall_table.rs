//! Tables with one value per row: time, quantity, value, unit. Car Scanner writes these.

use crate::columns::{Column, speed_rank};
use crate::error::{ColumnProblem, Error, Result};
use crate::log::{DriveLog, Format, ReadOptions, Speed};
use crate::note::{LogNote, TableNote};
use crate::problem::SpeedProblem;
use crate::rows::{Astray, enough, left_out};
use crate::table::Table;
use crate::units::SpeedUnit;
use crate::wide_table::Times;
use std::collections::BTreeMap;

const QUANTITIES: [&str; 4] = ["pid", "sensor", "parameter", "signal"];
const VALUES: [&str; 1] = ["value"];
const UNITS: [&str; 2] = ["units", "unit"];

/// Whether a table has this form.
pub(crate) fn is_one(table: &Table) -> bool {
    table.named(&QUANTITIES).is_some() && table.named(&VALUES).is_some()
}

/// Reads the rows of the vehicle's speed.
pub(crate) fn read(table: &Table, options: &ReadOptions) -> Result<DriveLog> {
    let times = Times::of(table, options)?;
    let (Some(quantity), Some(value)) = (table.named(&QUANTITIES), table.named(&VALUES)) else {
        return Err(table.lacks(ColumnProblem::NoSpeed));
    };
    let unit = table.named(&UNITS);
    let (name, own_unit) = chosen(table, quantity, unit, options)?;
    let factor = match own_unit.or(options.unit) {
        Some(unit) => unit,
        None => return Err(table.lacks(ColumnProblem::NoSpeedUnit(name))),
    };
    let mut notes = vec![LogNote::from(TableNote::Rows {
        time: times.column.header.trim().to_owned(),
        name: name.clone(),
        unit: factor,
    })];
    let (mut rows, mut of_speed, mut absent) = (Vec::new(), 0, 0);
    for row in 0..table.len() {
        if table.word(row, quantity) != name {
            continue;
        }
        of_speed += 1;
        let Some(number) = table.number(row, value)? else {
            absent += 1;
            continue;
        };
        rows.push((row, number));
    }
    let (mut speeds, mut repeated) = (Vec::<Speed>::new(), 0);
    let mut astray = Astray::default();
    for (ns, (_, number)) in times.in_order(table, rows, &mut astray)? {
        if speeds.last().is_some_and(|last| last.ns == ns) {
            repeated += 1;
            continue;
        }
        speeds.push(Speed {
            ns,
            mps: number * factor.mps(),
            sigma_mps: None,
        });
    }
    left_out(&mut notes, of_speed, absent, repeated);
    let of_order = astray.notes(speeds.len() + repeated)?;
    notes.extend(of_order.into_iter().map(LogNote::from));
    enough(&table.path, &speeds)?;
    Ok(DriveLog {
        format: Format::TallTable,
        clock: times.clock,
        speeds,
        yaw_rates: Vec::new(),
        course_rates: Vec::new(),
        notes,
    })
}

/// The quantity that is the vehicle's speed, and its unit.
fn chosen(
    table: &Table,
    quantity: &Column,
    unit: Option<&Column>,
    options: &ReadOptions,
) -> Result<(String, Option<SpeedUnit>)> {
    let mut found: BTreeMap<&str, Option<SpeedUnit>> = BTreeMap::new();
    for row in 0..table.len() {
        let own = unit.and_then(|c| table.word(row, c).parse().ok());
        found.entry(table.word(row, quantity)).or_insert(own);
    }
    let missing = |problem| Error::NoSpeed {
        path: table.path.clone(),
        problem,
    };
    let measured = || found.keys().map(|name| (*name).to_owned()).collect();
    if let Some(name) = &options.speed {
        return match found.get_key_value(name.as_str()) {
            Some((name, unit)) => Ok(((*name).to_owned(), *unit)),
            None => Err(missing(SpeedProblem::NotMeasured {
                name: name.clone(),
                measured: measured(),
            })),
        };
    }
    // In another language the speed is recognised by its unit alone, if only one quantity has such a unit.
    let ranked = found.iter().filter_map(|(name, unit)| {
        let rank = speed_rank(&name.to_lowercase())?;
        Some(((unit.is_none(), rank, *name), *unit))
    });
    match ranked.min_by_key(|(rank, _)| *rank) {
        Some(((_, _, name), unit)) => Ok((name.to_owned(), unit)),
        None => Err(missing(SpeedProblem::NoneMeasured {
            measured: measured(),
        })),
    }
}
