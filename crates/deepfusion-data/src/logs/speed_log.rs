//! Reads `speed.csv`, and turns from it or from `imu.csv`: a yaw rate, or a complete inertial unit.

use super::clock::seconds;
use super::samples::Samples;
use super::table::{Column, Table};
use super::times::{TIMES, times};
use super::vehicle_log::{VehicleLog, imu_readings};
use crate::Receiver;
use crate::dataset_toml::FolderConfig;
use crate::{
    ConfigProblem, DataWarning, Error, MotionModel, MotionWarning, Quantity, Result, Stream,
    TimesWarning, VehicleTrack,
};
use deepfusion_logs::{Clock, DriveLog, ReadOptions, YawRate, is_gps_track};
use deepfusion_motion::{ImuMount, Signal};
use std::path::{Path, PathBuf};

/// A header of each table.
const SPEED_HEADER: &str = "time_s,speed_mps";
const IMU_HEADER: &str = "time_s,gyro_z_radps";
const COURSE_HEADER: &str = "time_s,course_rate_radps";
const SPEEDS: [&str; 4] = ["speed", "velocity", "vehicle_speed", "v"];
const SIGMAS: [&str; 3] = ["speed_sigma", "speed_accuracy", "speed_std"];
/// Longest gaps across which a receiver's turns and its standard deviations are interpolated, in seconds.
const COURSE_GAP_S: f64 = 3.0;
const SIGMA_GAP_S: f64 = 10.0;
const YAW_RATES: [&str; 6] = [
    "yaw_rate",
    "yawrate",
    "gyro_z",
    "wz",
    "omega_z",
    "angular_velocity_z",
];
const COURSE_RATES: [&str; 1] = ["course_rate"];

/// A recording's speeds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SpeedLog {
    pub(crate) path: PathBuf,
    pub(crate) speeds_mps: Samples,
    pub(crate) yaw_rates_radps: Option<Samples>,
    /// Rate of turn of the course over ground, if only positions give turns.
    pub(crate) course_rates_radps: Option<Samples>,
    /// Standard deviations of the speeds, if the log has them.
    pub(crate) sigmas_mps: Option<Samples>,
    /// Roll and pitch with their times (ns), if poses give them in addition to a yaw rate.
    pub(crate) tilts_rad: Vec<(i64, [f64; 2])>,
    /// An inertial unit, if all six of its columns exist. The motion is then fused from it and the speed.
    pub(crate) vehicle: Option<VehicleLog>,
    /// The streams found, for the inspection.
    pub(crate) streams: Vec<Stream>,
    pub(crate) warnings: Vec<DataWarning>,
}

impl SpeedLog {
    /// Reads the tables named in `dataset.toml`, or `speed.csv` and `imu.csv`, or a GPS track instead of the former;
    /// `None` without speeds.
    ///
    /// # Errors
    /// [`crate::Error::Config`] if a named table is missing, [`crate::Error::Log`] if another program's log cannot be read,
    /// [`crate::Error::Columns`] if a column or its unit is missing, [`crate::Error::Table`] for an invalid value or a decreasing time.
    pub(crate) fn read(folder: &Path, config: &FolderConfig) -> Result<Option<Self>> {
        let speed = config.find(folder, "speed", config.speed.as_ref(), &["speed.csv"])?;
        let imu = config.find(folder, "imu", config.imu.as_ref(), &["imu.csv"])?;
        let speed = match speed {
            None => only_track(folder, config)?,
            named => named,
        };
        let Some(path) = speed else {
            return Ok(None);
        };
        let mut warnings = Vec::new();
        let (mut yaw_rates_radps, mut vehicle) = (None, None);
        let (mut course_rates_radps, mut sigmas_mps) = (None, None);
        let (measured, table) = match own_or_foreign(&path, config)? {
            LogFile::Own(table) => {
                let ns = times(&table, config, &mut warnings, &name(&path), SPEED_HEADER)?;
                let column = table.require(&SPEEDS, SPEED_HEADER)?;
                let factor = speed_factor(&table, column, config)? * config.speed_scale();
                let values = scaled(table.numbers(column)?, factor);
                if let Some(column) = table.column(&SIGMAS) {
                    let factor = speed_factor(&table, column, config)? * config.speed_scale();
                    let values = scaled(table.numbers(column)?, factor);
                    let ns = ns.clone();
                    sigmas_mps = Some(Samples { ns, values });
                }
                (Samples { ns, values }, Some(table))
            }
            LogFile::Foreign(log) => {
                yaw_rates_radps =
                    turns(&log.yaw_rates).map(|turns| turns.bridged(config.max_gap_s, None));
                course_rates_radps = turns(&log.course_rates);
                sigmas_mps = sigmas(&log, config.speed_scale());
                (speeds(&path, &log, config, &mut warnings), None)
            }
        };
        let mut streams = vec![stream(&path, "speed", &measured.ns)];
        let mut yaw_table = None;
        if let Some(table) = &table
            && let Some(column) = table.column(&YAW_RATES)
        {
            yaw_table = Some((table.numbers(column)?, yaw_factor(table, column, config)?));
        }
        if let Some((values, factor)) = yaw_table {
            let yaw_rates = Samples {
                ns: measured.ns.clone(),
                values: scaled(values, factor),
            };
            yaw_rates_radps = Some(yaw_rates.bridged(config.max_gap_s, None));
        } else if let Some(imu) = imu {
            let table = Table::read(&imu)?;
            let ns = times(&table, config, &mut warnings, &name(&imu), IMU_HEADER)?;
            streams.push(stream(&imu, "imu", &ns));
            let readings = imu_readings(&table, &ns, |column| yaw_factor(&table, column, config))?;
            if let Some(imu) = readings {
                vehicle = Some(VehicleLog {
                    imu,
                    steering_rad: None,
                    config: config.motion(ImuMount::default()),
                });
            } else {
                let column = table.require(&YAW_RATES, IMU_HEADER)?;
                let factor = yaw_factor(&table, column, config)?;
                let values = scaled(table.numbers(column)?, factor);
                yaw_rates_radps = Some(Samples { ns, values }.bridged(config.max_gap_s, None));
            }
        } else if let Some(turns) = &yaw_rates_radps {
            streams.push(stream(&path, "imu", &turns.ns));
        } else {
            let log = name(&path);
            warnings.push(MotionWarning::NoYawRate { log }.into());
        }
        let turns_known = yaw_rates_radps.is_some() || vehicle.is_some();
        if course_rates_radps.is_none() && !turns_known {
            course_rates_radps = course_table(folder, config, &mut warnings)?;
        }
        let speeds_mps = measured.bridged(
            config.max_gap_s,
            Some((&mut warnings, &name(&path), "max_gap_s in dataset.toml")),
        );
        Ok(Some(Self {
            path,
            speeds_mps,
            yaw_rates_radps,
            course_rates_radps,
            sigmas_mps,
            tilts_rad: Vec::new(),
            vehicle,
            streams,
            warnings,
        }))
    }

    /// A GPS receiver's measurements other than speed, on the frames' clock.
    pub(crate) fn receiver(&self, origin_ns: i64) -> Receiver {
        let course = self.course_rates_radps.as_ref();
        receiver(course, self.sigmas_mps.as_ref(), origin_ns)
    }

    /// The vehicle's motion on the frames' clock, and whether its turns are known.
    ///
    /// # Errors
    /// [`Error::Motion`] for an inertial unit or a steering angle that cannot be used as configured.
    pub(crate) fn motion(&self, origin_ns: i64) -> Result<(MotionModel, bool)> {
        match &self.vehicle {
            Some(vehicle) => {
                let motion = vehicle.motion(&self.speeds_mps, origin_ns);
                motion.map_err(|source| Error::Motion {
                    path: self.path.clone(),
                    source,
                })
            }
            None => Ok((self.track(origin_ns).into(), self.yaw_rates_radps.is_some())),
        }
    }

    /// The motion from speed and yaw rate only. If the two have different times, the track has samples at
    /// both: between samples both are linear, so that its integrals stay exact.
    fn track(&self, origin_ns: i64) -> VehicleTrack {
        let Some(yaw) = &self.yaw_rates_radps else {
            let samples = self.speeds_mps.ns.iter().zip(&self.speeds_mps.values);
            let samples: Vec<_> = samples
                .map(|(ns, v)| (seconds(*ns, origin_ns), *v, 0.0))
                .collect();
            return VehicleTrack::new(&samples);
        };
        let mut times: Vec<i64> = self.speeds_mps.ns.iter().chain(&yaw.ns).copied().collect();
        times.sort_unstable();
        times.dedup();
        let known = times.iter().filter_map(|ns| {
            let (v, w) = (self.speeds_mps.at(*ns)?, yaw.at(*ns)?);
            Some((seconds(*ns, origin_ns), v, w))
        });
        let track = VehicleTrack::new(&known.collect::<Vec<_>>());
        if self.tilts_rad.is_empty() {
            return track;
        }
        let tilts = self.tilts_rad.iter();
        let tilts = tilts.map(|(ns, [roll, pitch])| (seconds(*ns, origin_ns), *roll, *pitch));
        track.with_tilt(&tilts.collect::<Vec<_>>())
    }
}

/// A GPS receiver's measurements other than speed, on the frames' clock: rate of turn of its course (rad/s), and standard deviations of the
/// speeds (m/s).
pub(crate) fn receiver(
    course_rates_radps: Option<&Samples>,
    sigmas_mps: Option<&Samples>,
    origin_ns: i64,
) -> Receiver {
    let signal = |samples: &Samples, gap_s: f64| {
        let pairs = samples.ns.iter().zip(&samples.values);
        let pairs = pairs.map(|(ns, value)| (seconds(*ns, origin_ns), *value));
        Signal::with_max_gap(pairs, gap_s)
    };
    Receiver {
        course_rate_radps: course_rates_radps.map(|samples| signal(samples, COURSE_GAP_S)),
        speed_sigma_mps: sigmas_mps.map(|samples| signal(samples, SIGMA_GAP_S)),
    }
}

/// A table in this program's format, or another program's log.
enum LogFile {
    Own(Table),
    Foreign(DriveLog),
}

/// Reads a table in this program's format, according to its column names, or anything else with `deepfusion-logs`. If that cannot read
/// a table either, the error is this program's own, which describes its format.
fn own_or_foreign(path: &Path, config: &FolderConfig) -> Result<LogFile> {
    let options = ReadOptions {
        time: config.time_column.clone(),
        speed: config.speed_column.clone(),
        unit: config
            .speed_unit
            .as_deref()
            .and_then(|unit| unit.parse().ok()),
        dbc: config.dbc.as_ref().map(|file| config.folder().join(file)),
    };
    let foreign = || deepfusion_logs::read(path, &options).map(LogFile::Foreign);
    let is_table = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let configured = options.time.is_some() || options.speed.is_some() || options.dbc.is_some();
    if configured || path.is_dir() || !is_table {
        return Ok(foreign()?);
    }
    let own = Table::read(path).and_then(|table| {
        table.require(&TIMES, "time_s,speed_mps")?;
        table.require(&SPEEDS, "time_s,speed_mps")?;
        Ok(table)
    });
    own.map(LogFile::Own)
        .or_else(|error| foreign().map_err(|_| error))
}

/// Path of the only GPS track in a folder.
///
/// # Errors
/// [`Error::Config`] if there are several, [`Error::File`].
fn only_track(folder: &Path, config: &FolderConfig) -> Result<Option<PathBuf>> {
    let mut tracks = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        if path.is_file() && is_gps_track(&path) {
            tracks.push(path);
        }
    }
    match tracks.len() {
        0 | 1 => Ok(tracks.pop()),
        count => Err(config.error(ConfigProblem::SeveralTracks { count })),
    }
}

/// The speeds in another program's log; notes on how it was interpreted are added to the warnings.
fn speeds(
    path: &Path,
    log: &DriveLog,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Samples {
    let name = name(path);
    warnings.extend(log.notes.iter().map(|note| {
        DataWarning::from(MotionWarning::Understood {
            log: name.clone(),
            note: note.clone(),
        })
    }));
    if log.clock == Clock::LocalDate {
        warnings.push(TimesWarning::NoZone { log: name }.into());
    }
    Samples {
        ns: log.speeds.iter().map(|s| s.ns).collect(),
        values: scaled(
            log.speeds.iter().map(|s| s.mps).collect(),
            config.speed_scale(),
        ),
    }
}

/// The yaw rates in another program's log, if any.
fn turns(rates: &[YawRate]) -> Option<Samples> {
    (!rates.is_empty()).then(|| Samples {
        ns: rates.iter().map(|y| y.ns).collect(),
        values: rates.iter().map(|y| y.radps).collect(),
    })
}

/// The standard deviations of the speeds in another program's log, if any.
fn sigmas(log: &DriveLog, scale: f64) -> Option<Samples> {
    let known = log.speeds.iter().filter_map(|s| Some((s.ns, s.sigma_mps?)));
    let (ns, values): (Vec<i64>, Vec<f64>) = known.unzip();
    let values = scaled(values, scale);
    (!ns.is_empty()).then_some(Samples { ns, values })
}

/// Reads `course.csv`, which `deepfusion-logs` writes for a track of positions. A table of that name without its column is another
/// program's.
fn course_table(
    folder: &Path,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Result<Option<Samples>> {
    let Some(path) = config.find(folder, "course", None, &["course.csv"])? else {
        return Ok(None);
    };
    let table = match Table::read(&path) {
        Ok(table) if table.column(&COURSE_RATES).is_some() => table,
        Ok(_) => {
            warnings.push(MotionWarning::NoCourseRates.into());
            return Ok(None);
        }
        Err(error @ (Error::Table { .. } | Error::Row { .. })) => {
            let why = error.to_string();
            warnings.push(MotionWarning::CourseNotRead { why }.into());
            return Ok(None);
        }
        Err(error) => return Err(error),
    };
    let ns = times(&table, config, warnings, &name(&path), COURSE_HEADER)?;
    let column = table.require(&COURSE_RATES, COURSE_HEADER)?;
    let factor = yaw_factor(&table, column, config)?;
    let values = scaled(table.numbers(column)?, factor);
    Ok(Some(Samples { ns, values }))
}

/// Factor from the column's unit to m/s.
fn speed_factor(table: &Table, column: &Column, config: &FolderConfig) -> Result<f64> {
    let unit = column.unit.as_deref().or(config.speed_unit.as_deref());
    match unit {
        Some("mps" | "m/s") => Ok(1.0),
        Some("kmh" | "km/h" | "kph") => Ok(1.0 / 3.6),
        Some("mph" | "mi/h") => Ok(0.447_04),
        other => Err(table.no_unit(Quantity::Speed, column, other)),
    }
}

/// Factor from the column's unit to rad/s.
fn yaw_factor(table: &Table, column: &Column, config: &FolderConfig) -> Result<f64> {
    let unit = column.unit.as_deref().or(config.yaw_rate_unit.as_deref());
    match unit {
        Some("radps" | "rad/s" | "rad s^-1") => Ok(1.0),
        Some("dps" | "degps" | "deg/s" | "°/s") => Ok(1_f64.to_radians()),
        other => Err(table.no_unit(Quantity::YawRate, column, other)),
    }
}

fn scaled(values: Vec<f64>, factor: f64) -> Vec<f64> {
    values.into_iter().map(|v| v * factor).collect()
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

fn stream(path: &Path, kind: &'static str, ns: &[i64]) -> Stream {
    let first = ns.first().copied().unwrap_or_default();
    let times: Vec<f64> = ns.iter().map(|t| seconds(*t, first)).collect();
    Stream::new(&name(path), kind, ns.len(), &times)
}

#[cfg(test)]
#[path = "speed_log_tests.rs"]
mod tests;
