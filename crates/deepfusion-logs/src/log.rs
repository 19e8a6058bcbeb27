use crate::{LogNote, SpeedUnit};
use std::fmt;
use std::path::PathBuf;

/// How a vehicle moved, read from a log.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// Format of the log.
    pub format: Format,
    /// The clock of its times.
    pub clock: Clock,
    /// Speeds, in the order of their times; no two have the same time.
    pub speeds: Vec<Speed>,
    /// Yaw rates, in the order of their own times; empty if none were measured.
    pub yaw_rates: Vec<YawRate>,
    /// Yaw rates of the course over ground, from positions while the vehicle moved. In the order of their times, and smoothed over a
    /// second or so: enough to find the offset of two clocks, but not how a camera turned from one image to the next.
    pub course_rates: Vec<YawRate>,
    /// How the log was interpreted, and what was left out.
    pub notes: Vec<LogNote>,
}

impl DriveLog {
    /// The same log with the time zone of its local dates: `ahead_s` seconds ahead of UTC. Logs with another clock stay as they are.
    #[must_use]
    pub fn in_zone(mut self, ahead_s: i64) -> Self {
        if self.clock == Clock::LocalDate {
            let ahead_ns = ahead_s.saturating_mul(1_000_000_000);
            let moved = |ns: &mut i64| *ns = ns.saturating_sub(ahead_ns);
            self.speeds.iter_mut().for_each(|s| moved(&mut s.ns));
            let turns = self.yaw_rates.iter_mut().chain(&mut self.course_rates);
            turns.for_each(|turn| moved(&mut turn.ns));
            self.clock = Clock::Date;
        }
        self
    }
}

/// A speed at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed {
    /// Time on the log's clock, in nanoseconds.
    pub ns: i64,
    /// Speed in m/s; negative backwards, if the log tells the direction.
    pub mps: f64,
    /// Standard deviation of the speed in m/s, if it is known.
    pub sigma_mps: Option<f64>,
}

/// A rate of rotation about the axis that points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct YawRate {
    /// Time on the log's clock, in nanoseconds.
    pub ns: i64,
    /// Rate in rad/s, positive to the left.
    pub radps: f64,
}

/// The time from which a log's times count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// The beginning of 1970, UTC.
    Date,
    /// The beginning of 1970 on a local clock: UTC may be some hours off.
    LocalDate,
    /// Midnight.
    TimeOfDay,
    /// A moment chosen by the recorder.
    Free,
    /// The first frame of the video that contains the log.
    Video,
}

/// Formats of logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A GPS track as XML.
    Gpx,
    /// A receiver's NMEA sentences.
    Nmea,
    /// A table with a column per quantity.
    Table,
    /// A table with one value per row, as Car Scanner writes it.
    TallTable,
    /// A phone's export: a folder with a table per sensor.
    ExportFolder,
    /// The text format of Google's GnssLogger.
    GnssLogger,
    /// The metadata track of a GoPro's video.
    Gpmf,
    /// CAN frames with a DBC file.
    CanTrace,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gpx => "GPX track",
            Self::Nmea => "NMEA sentences",
            Self::Table => "table",
            Self::TallTable => "table with one value per row (Car Scanner)",
            Self::ExportFolder => "phone's export folder",
            Self::GnssLogger => "GnssLogger text",
            Self::Gpmf => "GoPro video",
            Self::CanTrace => "CAN trace",
        })
    }
}

/// What a user says about a log that does not say it itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Header of the column of times.
    pub time: Option<String>,
    /// Header of the column of speeds; for a tall table the name of its rows, for a CAN trace the signal, "Message.Signal".
    pub speed: Option<String>,
    /// Unit of the speeds, if the log does not give one; the log's own unit takes precedence.
    pub unit: Option<SpeedUnit>,
    /// Path of a DBC file, for CAN traces.
    pub dbc: Option<PathBuf>,
}

impl ReadOptions {
    /// The same options with columns by their usual names.
    pub(crate) fn without_columns(&self) -> Self {
        Self {
            time: None,
            speed: None,
            ..self.clone()
        }
    }
}
