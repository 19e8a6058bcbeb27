//! A phone's export folder: a table for each sensor, as Sensor Logger and phyphox write them.

use crate::error::{Error, Result};
use crate::log::{Clock, DriveLog, Format, ReadOptions};
use crate::note::{LogNote, TurnsNote};
use crate::problem::SpeedProblem;
use crate::rows::text_of;
use crate::table::Table;
use crate::turns::{Heading, Sensor, yaw_rates};
use crate::wide_table::{self, Times};
use nalgebra::Vector3;
use std::path::Path;

/// Files of positions, the better first.
static LOCATIONS: [&str; 4] = [
    "LocationGps.csv",
    "Location.csv",
    "GPS.csv",
    "Location (GPS).csv",
];
const GYROSCOPES: [&str; 2] = ["Gyroscope.csv", "Gyroscope rotation rate.csv"];
/// Accelerations with gravity, the better first.
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
    let file = location
        .path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    if let Some(first) = log.notes.first_mut() {
        let note = Box::new(first.clone());
        *first = LogNote::OfFile { file, note };
    }
    let (Some(gyroscope), Some(gravity)) = (table(&GYROSCOPES)?, table(&GRAVITIES)?) else {
        log.notes.push(TurnsNote::NoGyroscope.into());
        return Ok(log);
    };
    let rates = axes(&gyroscope, options, log.clock)?;
    let accelerations = axes(&gravity, options, log.clock)?;
    let heading = headings(&location, options)?;
    let (turns, note) = yaw_rates(&rates, &accelerations, &heading);
    log.yaw_rates = turns;
    log.notes.push(note.into());
    Ok(log)
}

/// The three axes of a sensor over time, in the units of the file: rad/s, m/s². Their times are in the column that was asked for where there is
/// such, and on the positions' clock.
fn axes(table: &Table, options: &ReadOptions, clock: Clock) -> Result<Vec<Sensor>> {
    let asked = options.time.clone();
    let times = Times::of(
        table,
        &ReadOptions {
            time: asked.filter(|name| table.asked_for(name).is_ok()),
            ..options.clone()
        },
    )?;
    if times.clock != clock {
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
    let (mut all, mut last) = (Vec::with_capacity(table.len()), None);
    for row in 0..table.len() {
        let values = (
            table.number(row, x)?,
            table.number(row, y)?,
            table.number(row, z)?,
        );
        let (Some(x), Some(y), Some(z)) = values else {
            continue;
        };
        let ns = times.ns(table, row, last)?;
        if last == Some(ns) {
            continue;
        }
        last = Some(ns);
        all.push(Sensor {
            ns,
            value: Vector3::new(x, y, z) * factor,
        });
    }
    Ok(all)
}

/// The directions of travel that the satellites saw, while the vehicle was fast enough to have one.
fn headings(table: &Table, options: &ReadOptions) -> Result<Vec<Heading>> {
    let bearing = table.named(&["bearing", "direction", "course", "heading"]);
    let (Some(bearing), Some(speed)) = (
        bearing,
        table.columns.iter().find(|c| c.speed_rank().is_some()),
    ) else {
        return Ok(Vec::new());
    };
    let times = Times::of(table, options)?;
    let (mut all, mut last) = (Vec::new(), None);
    for row in 0..table.len() {
        let (Some(degrees), Some(speed)) = (table.number(row, bearing)?, table.number(row, speed)?)
        else {
            continue;
        };
        let ns = times.ns(table, row, last)?;
        last = Some(ns);
        // Below a brisk walk the course of a receiver is noise.
        if speed > 3.0 && degrees >= 0.0 {
            all.push(Heading {
                ns,
                clockwise_rad: degrees.to_radians(),
            });
        }
    }
    Ok(all)
}
