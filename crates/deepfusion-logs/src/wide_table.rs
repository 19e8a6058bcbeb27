//! A table with a column per quantity.

use crate::columns::{Column, TIMES};
use crate::dates::{TimeStyle, clock_of, nanoseconds, style_of};
use crate::error::{ColumnProblem, Error, Result};
use crate::log::{Clock, DriveLog, Format, ReadOptions, Speed, YawRate};
use crate::note::{LogNote, TableNote};
use crate::problem::{SpeedProblem, TableProblem};
use crate::rows::{Astray, enough, left_out};
use crate::table::{Table, short};
use crate::track::{self, TimedFix};
use crate::units::SpeedUnit;
use deepfusion_motion::Fix;

/// The times of a table's rows.
pub(crate) struct Times<'a> {
    pub(crate) column: &'a Column,
    style: TimeStyle,
    pub(crate) clock: Clock,
}

impl<'a> Times<'a> {
    /// Finds the column, and how its times are written.
    pub(crate) fn of(table: &'a Table, options: &ReadOptions) -> Result<Self> {
        let column = match &options.time {
            Some(name) => table.asked_for(name)?,
            None => table
                .named(&TIMES)
                .ok_or_else(|| table.lacks(ColumnProblem::NoTime))?,
        };
        let words: Vec<String> = (0..table.len().min(1000))
            .map(|row| table.plain_word(row, column))
            .collect();
        let words: Vec<&str> = words
            .iter()
            .map(String::as_str)
            .filter(|w| !w.is_empty())
            .collect();
        let Some(first) = words.first() else {
            return Err(Error::NoSpeed {
                path: table.path.clone(),
                problem: SpeedProblem::NoTime,
            });
        };
        // A column of numbers may be named after its unit: "seconds", "UnixTimeMillis".
        let unit = column.unit.as_deref().or(match column.name.as_str() {
            "seconds" | "seconds elapsed" => Some("s"),
            "unixtimemillis" => Some("ms"),
            _ => None,
        });
        let style = style_of(&words, unit).ok_or_else(|| match first.parse::<f64>() {
            Ok(_) => table.lacks(ColumnProblem::NoTimeUnit(column.header.clone())),
            Err(_) => {
                let text = short(first);
                table.bad(0, column, TableProblem::NotATime { text })
            }
        })?;
        Ok(Self {
            column,
            style,
            clock: clock_of(first, style),
        })
    }

    /// The times of these rows, each with the value read from the row; rows that are out of order go to `astray`.
    pub(crate) fn in_order<T>(
        &self,
        table: &Table,
        rows: Vec<(usize, T)>,
        astray: &mut Astray,
    ) -> Result<Vec<(i64, (usize, T))>> {
        // For clocks that pass midnight.
        let mut latest = None;
        let mut timed = Vec::with_capacity(rows.len());
        for (row, read) in rows {
            let word = table.plain_word(row, self.column);
            let ns = nanoseconds(&word, self.style, latest).ok_or_else(|| {
                let text = short(&word);
                table.bad(row, self.column, TableProblem::NotATime { text })
            })?;
            latest = latest.max(Some(ns));
            timed.push((ns, (row, read)));
        }
        Ok(astray.leave_out(timed, |(row, _), back_ns| {
            let problem = TableProblem::Backwards {
                text: short(&table.plain_word(*row, self.column)),
                back_s: back_ns as f64 * 1e-9,
            };
            table.bad(*row, self.column, problem)
        }))
    }
}

/// Reads a table with a column per quantity.
pub(crate) fn read(table: &Table, options: &ReadOptions) -> Result<DriveLog> {
    let times = Times::of(table, options)?;
    let speed = match &options.speed {
        Some(name) => Some(table.asked_for(name)?),
        None => best_speed(table, options.unit),
    };
    let mut notes = Vec::new();
    if table.repeated_headers > 0 {
        let more = table.repeated_headers;
        notes.push(LogNote::from(TableNote::HeaderAgain { more }));
    }
    let Some(column) = speed else {
        return positions(table, &times, notes);
    };
    // Sensor Logger's columns, which no other program writes together.
    let phone_export = table.named(&["seconds elapsed"]).is_some()
        && table.named(&ACCURACY).is_some()
        && table
            .named(&["horizontalaccuracy", "bearingaccuracy"])
            .is_some();
    let unit = match column.speed_unit().or(options.unit) {
        Some(unit) => unit,
        // Sensor Logger's documentation: metres a second.
        None if phone_export || column.name == "speedmps" => SpeedUnit::MetresPerSecond,
        None => return Err(table.lacks(ColumnProblem::NoSpeedUnit(column.header.clone()))),
    };
    let of_columns = TableNote::Column {
        time: times.column.header.trim().to_owned(),
        speed: column.header.trim().to_owned(),
        unit,
    };
    notes.insert(0, of_columns.into());
    let accuracy = table.named(&ACCURACY);
    let of_accuracy = accuracy.and_then(Column::speed_unit).unwrap_or(unit);
    let (mut rows, mut absent) = (Vec::new(), 0);
    for row in 0..table.len() {
        let value = table.number(row, column)?;
        // A phone without a fix writes -1.
        let value = value.filter(|v| !(phone_export && *v < 0.0));
        let Some(value) = value else {
            absent += 1;
            continue;
        };
        if times_absent(table, &times, row) {
            absent += 1;
            continue;
        }
        rows.push((row, value));
    }
    let (mut speeds, mut repeated) = (Vec::<Speed>::new(), 0);
    let mut astray = Astray::default();
    for (ns, (row, value)) in times.in_order(table, rows, &mut astray)? {
        if speeds.last().is_some_and(|last| last.ns == ns) {
            repeated += 1;
            continue;
        }
        let sigma = accuracy
            .map(|c| table.number(row, c))
            .transpose()?
            .flatten();
        speeds.push(Speed {
            ns,
            mps: value * unit.mps(),
            sigma_mps: sigma.filter(|s| *s > 0.0).map(|s| s * of_accuracy.mps()),
        });
    }
    left_out(&mut notes, table.len(), absent, repeated);
    let of_order = astray.notes(speeds.len() + repeated)?;
    notes.extend(of_order.into_iter().map(LogNote::from));
    enough(&table.path, &speeds)?;
    Ok(DriveLog {
        format: Format::Table,
        clock: times.clock,
        speeds,
        yaw_rates: yaw_rates(table, &times, &mut notes)?,
        course_rates: Vec::new(),
        notes,
    })
}

/// Names of a speed's standard deviation.
const ACCURACY: [&str; 2] = ["speedaccuracy", "speed accuracy"];

/// Names of a vehicle's yaw rate. A gyroscope's own axes are not among them: its mounting is unknown.
const YAW_RATE: [&str; 3] = ["yaw rate", "yawrate", "yaw velocity"];

/// One unit of rotation in rad/s, in the spellings that recorders use.
fn radps_of(unit: &str) -> Option<f64> {
    match unit {
        "rad/s" | "radps" | "rad/sec" => Some(1.0),
        "deg/s" | "dps" | "degps" | "deg/sec" | "°/s" | "degrees/s" => Some(1f64.to_radians()),
        _ => None,
    }
}

/// The yaw rates of the rows that have one. Without a known unit, none and a note.
fn yaw_rates(table: &Table, times: &Times, notes: &mut Vec<LogNote>) -> Result<Vec<YawRate>> {
    let Some(column) = table.named(&YAW_RATE) else {
        return Ok(Vec::new());
    };
    let header = || column.header.trim().to_owned();
    let Some(radps) = column.unit.as_deref().and_then(radps_of) else {
        let of_unknown = TableNote::YawRateUnit {
            column: header(),
            unit: column.unit.clone(),
        };
        notes.push(of_unknown.into());
        return Ok(Vec::new());
    };
    let mut rows = Vec::new();
    for row in 0..table.len() {
        let value = table.number(row, column)?;
        let value = value.filter(|_| !times_absent(table, times, row));
        rows.extend(value.map(|value| (row, value)));
    }
    let mut astray = Astray::default();
    let rows = times.in_order(table, rows, &mut astray)?;
    // For rows that also have a speed, this has been noted already.
    for note in astray.notes(rows.len())?.into_iter().map(LogNote::from) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    let turns = rows.into_iter().map(|(ns, (_, value))| YawRate {
        ns,
        radps: value * radps,
    });
    let mut found: Vec<YawRate> = turns.collect();
    // The first of several rows with the same time.
    found.dedup_by_key(|turn| turn.ns);
    if !found.is_empty() {
        notes.push(TableNote::YawRate { column: header() }.into());
    }
    Ok(found)
}

fn times_absent(table: &Table, times: &Times, row: usize) -> bool {
    ["", "-"].contains(&table.word(row, times.column))
}

/// The column that fits a vehicle's speed best; of equally good ones the first with a known unit, else the first.
fn best_speed(table: &Table, unit: Option<SpeedUnit>) -> Option<&Column> {
    let ranked = table
        .columns
        .iter()
        .filter_map(|c| Some((c.speed_rank()?, c)));
    // An empty column is ignored: OBD apps list quantities that the vehicle never sent.
    let filled =
        |c: &Column| (0..table.len()).any(|row| matches!(table.number(row, c), Ok(Some(_))));
    let with_unit = |c: &Column| c.speed_unit().or(unit).is_some();
    ranked
        .filter(|(_, c)| filled(c))
        .min_by_key(|(rank, c)| (!with_unit(c), *rank, c.index))
        .map(|(_, c)| c)
}

/// Speeds from a table's latitudes and longitudes.
fn positions(table: &Table, times: &Times, mut notes: Vec<LogNote>) -> Result<DriveLog> {
    let degrees = (
        table.named(&["latitude", "lat", "latitudedegrees"]),
        table.named(&[
            "longitude",
            "lon",
            "lng",
            "long",
            "longtitude",
            "longitudedegrees",
        ]),
    );
    let (Some(latitude), Some(longitude)) = degrees else {
        return Err(table.lacks(ColumnProblem::NoSpeed));
    };
    let (mut rows, mut beyond) = (Vec::new(), Vec::new());
    for row in 0..table.len() {
        let place = (table.number(row, latitude)?, table.number(row, longitude)?);
        let (Some(latitude_deg), Some(longitude_deg)) = place else {
            continue;
        };
        // Before its first fix an app writes 0, 0.
        if times_absent(table, times, row) || (latitude_deg == 0.0 && longitude_deg == 0.0) {
            continue;
        }
        // 91, 181 or 999 without a fix; all values are such if the unit is a different one.
        if latitude_deg.abs() > 90.0 || longitude_deg.abs() > 360.0 {
            beyond.push((row, latitude_deg, longitude_deg));
            continue;
        }
        let fix = Fix {
            time_s: 0.0,
            latitude_deg,
            longitude_deg,
            speed_mps: None,
        };
        rows.push((row, fix));
    }
    let mut astray = Astray::default();
    let rows = times.in_order(table, rows, &mut astray)?;
    let fixes = rows
        .into_iter()
        .map(|(ns, (_, fix))| TimedFix { ns, fix })
        .collect::<Vec<_>>();
    if let (true, Some(&(row, north, east))) = (fixes.is_empty(), beyond.first()) {
        let problem = TableProblem::NoDegrees {
            latitude: north,
            longitude: east,
        };
        return Err(table.bad(row, latitude, problem));
    }
    let of_order = astray.notes(fixes.len())?;
    notes.extend(of_order.into_iter().map(LogNote::from));
    if !beyond.is_empty() {
        let (beyond, rows) = (beyond.len(), table.len());
        notes.push(TableNote::NoDegrees { beyond, rows }.into());
    }
    let of_columns = TableNote::Positions {
        time: times.column.header.trim().to_owned(),
        latitude: latitude.header.trim().to_owned(),
        longitude: longitude.header.trim().to_owned(),
    };
    notes.push(of_columns.into());
    let yaw_rates = yaw_rates(table, times, &mut notes)?;
    let mut log = track::log_of_fixes(&table.path, Format::Table, &fixes)?;
    notes.append(&mut log.notes);
    Ok(DriveLog {
        clock: times.clock,
        yaw_rates,
        notes,
        ..log
    })
}
