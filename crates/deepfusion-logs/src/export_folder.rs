//! A phone's export folder: a table per sensor, as Sensor Logger and phyphox write them.

use crate::error::{Error, Result};
use crate::log::{DriveLog, Format, ReadOptions};
use crate::note::{LogNote, TurnsNote};
use crate::problem::SpeedProblem;
use crate::rows::{Astray, text_of};
use crate::table::Table;
use crate::turns::{Heading, Sensor, yaw_rates};
use crate::wide_table::{self, Times};
use nalgebra::Vector3;
use std::path::Path;

/// Files of positions, in order of preference.
static LOCATIONS: [&str; 4] = [
    "LocationGps.csv",
    "Location.csv",
    "GPS.csv",
    "Location (GPS).csv",
];
const GYROSCOPES: [&str; 2] = ["Gyroscope.csv", "Gyroscope rotation rate.csv"];
/// Accelerations with gravity, in order of preference.
const GRAVITIES: [&str; 5] = [
    "Gravity.csv",
    "TotalAcceleration.csv",
    "Acceleration (with g).csv",
    "Accelerometer.csv",
    "Raw Data.csv",
];

/// Reads the speeds of the folder's positions, and the turns of its gyroscope.
pub(crate) fn read(folder: &Path, options: &ReadOptions) -> Result<DriveLog> {
    let table = |names: &[&str]| -> Result<Option<Table>> {
        let path = names.iter().map(|n| folder.join(n)).find(|p| p.is_file());
        path.map(|p| Table::parse(&p, &text_of(&p)?, 1)).transpose()
    };
    let Some(location) = table(&LOCATIONS)? else {
        return Err(Error::NoSpeed {
            path: folder.to_owned(),
            problem: SpeedProblem::NoLocations {
                expected: &LOCATIONS,
            },
        });
    };
    let mut log = wide_table::read(&location, options)?;
    log.format = Format::ExportFolder;
    if let Some(first) = log.notes.first_mut() {
        *first = of_file(&location, first.clone());
    }
    let (Some(gyroscope), Some(gravity)) = (table(&GYROSCOPES)?, table(&GRAVITIES)?) else {
        log.notes.push(TurnsNote::NoGyroscope.into());
        return Ok(log);
    };
    let rates = axes(&gyroscope, options, &mut log)?;
    let accelerations = axes(&gravity, options, &mut log)?;
    let heading = headings(&location, options)?;
    let (turns, note) = yaw_rates(&rates, &accelerations, &heading);
    log.yaw_rates = turns;
    log.notes.push(note.into());
    Ok(log)
}

/// A note on one of the folder's tables.
fn of_file(table: &Table, note: LogNote) -> LogNote {
    let name = table.path.file_name().unwrap_or_default();
    LogNote::OfFile {
        file: name.to_string_lossy().into_owned(),
        note: Box::new(note),
    }
}

/// The three axes of a sensor over time, in the units of the file: rad/s, m/s². Their times are in the requested column if the table has
/// it, and on the positions' clock: that of `log`, which gets a note if rows are left out.
fn axes(table: &Table, options: &ReadOptions, log: &mut DriveLog) -> Result<Vec<Sensor>> {
    let asked = options.time.clone();
    let times = Times::of(
        table,
        &ReadOptions {
            time: asked.filter(|name| table.asked_for(name).is_ok()),
            ..options.clone()
        },
    )?;
    if times.clock != log.clock {
        let path = table.path.clone();
        return Err(Error::OtherClock { path });
    }
    let axis = |letter: &'static str| {
        let fits = |name: &str| name == letter || name.ends_with(&format!(" {letter}"));
        table
            .columns
            .iter()
            .find(|c| fits(&c.name))
            .ok_or_else(|| Error::NoSpeed {
                path: table.path.clone(),
                problem: SpeedProblem::NoAxis { axis: letter },
            })
    };
    let (x, y, z) = (axis("x")?, axis("y")?, axis("z")?);
    let degrees = x
        .unit
        .as_deref()
        .is_some_and(|u| u.contains('°') || u.contains("deg"));
    let factor = if degrees { 1_f64.to_radians() } else { 1.0 };
    let mut rows = Vec::with_capacity(table.len());
    for row in 0..table.len() {
        let values = (
            table.number(row, x)?,
            table.number(row, y)?,
            table.number(row, z)?,
        );
        let (Some(x), Some(y), Some(z)) = values else {
            continue;
        };
        rows.push((row, Vector3::new(x, y, z) * factor));
    }
    let mut astray = Astray::default();
    let rows = times.in_order(table, rows, &mut astray)?;
    let of_order = astray.notes(rows.len())?.into_iter();
    log.notes
        .extend(of_order.map(|note| of_file(table, note.into())));
    let readings = rows.into_iter();
    let readings = readings.map(|(ns, (_, value))| Sensor { ns, value });
    let mut all: Vec<Sensor> = readings.collect();
    // The first of several rows with the same time.
    all.dedup_by_key(|reading| reading.ns);
    Ok(all)
}

/// The directions of travel that the satellites gave, while the vehicle was fast enough to have one.
fn headings(table: &Table, options: &ReadOptions) -> Result<Vec<Heading>> {
    let bearing = table.named(&["bearing", "direction", "course", "heading"]);
    let (Some(bearing), Some(speed)) = (
        bearing,
        table.columns.iter().find(|c| c.speed_rank().is_some()),
    ) else {
        return Ok(Vec::new());
    };
    let times = Times::of(table, options)?;
    let mut rows = Vec::new();
    for row in 0..table.len() {
        let (Some(degrees), Some(speed)) = (table.number(row, bearing)?, table.number(row, speed)?)
        else {
            continue;
        };
        rows.push((row, (degrees, speed)));
    }
    let mut astray = Astray::default();
    let rows = times.in_order(table, rows, &mut astray)?;
    // The speeds of these rows have their own notes.
    astray.notes(rows.len())?;
    // Below a brisk walk the course of a receiver is noise.
    let is_known = |(degrees, speed): (f64, f64)| speed > 3.0 && degrees >= 0.0;
    let known = rows.into_iter().filter(|(_, (_, read))| is_known(*read));
    let headings = known.map(|(ns, (_, (degrees, _)))| Heading {
        ns,
        clockwise_rad: degrees.to_radians(),
    });
    Ok(headings.collect())
}
