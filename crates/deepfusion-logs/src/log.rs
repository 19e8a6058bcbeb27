use crate::{LogNote, SpeedUnit};
use std::fmt;
use std::path::PathBuf;

/// What a log says of how its vehicle moved.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveLog {
    /// What kind of log it was.
    pub format: Format,
    /// From when its times count.
    pub clock: Clock,
    /// In the order of their times, no two at one time.
    pub speeds: Vec<Speed>,
    /// In the order of their times; empty where nothing measured them. They have times of their own.
    pub yaw_rates: Vec<YawRate>,
    /// How the course over ground turned, by positions, where the vehicle moved; in the order of their times, spread over a
    /// second or so. Enough to tell how far two clocks are apart, not how a camera turned from one image to the next.
    pub course_rates: Vec<YawRate>,
    /// How the log was understood, and what of it was left out.
    pub notes: Vec<LogNote>,
}

impl DriveLog {
    /// The same with the zone of its local dates said: `ahead_s` seconds ahead of UTC. Logs of another clock stay as they are.
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

/// A speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed {
    /// On the log's clock, in nanoseconds.
    pub ns: i64,
    /// In m/s; negative backwards, where the log knows.
    pub mps: f64,
    /// Its standard deviation in m/s, where something tells it.
    pub sigma_mps: Option<f64>,
}

/// A rate of turning about the axis that points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct YawRate {
    /// On the log's clock, in nanoseconds.
    pub ns: i64,
    /// In rad/s, positive to the left.
    pub radps: f64,
}

/// From when times count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// From the beginning of 1970, UTC.
    Date,
    /// From the beginning of 1970 of a local clock: hours may be added to UTC.
    LocalDate,
    /// From a midnight.
    TimeOfDay,
    /// From some moment of the recorder's own.
    Free,
    /// From the first frame of the video that the log was taken out of.
    Video,
}

/// Kinds of logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A GPS track as XML.
    Gpx,
    /// A receiver's sentences.
    Nmea,
    /// A table with a column for each quantity.
    Table,
    /// A table with one value a row, as Car Scanner writes it.
    TallTable,
    /// A phone's export: a folder of tables, one for each sensor.
    ExportFolder,
    /// The text of Google's GnssLogger.
    GnssLogger,
    /// The metadata track of a GoPro's video.
    Gpmf,
    /// CAN frames, and a DBC file.
    CanTrace,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gpx => "GPX track",
            Self::Nmea => "NMEA sentences",
            Self::Table => "table",
            Self::TallTable => "table of one value a row (Car Scanner)",
            Self::ExportFolder => "phone's export folder",
            Self::GnssLogger => "GnssLogger text",
            Self::Gpmf => "GoPro video",
            Self::CanTrace => "CAN trace",
        })
    }
}

/// What a user says of a log, where it does not say it itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The column of times, by its header.
    pub time: Option<String>,
    /// The column of speeds by its header; of a tall table the name of its rows; of a CAN trace the signal, "Message.Signal".
    pub speed: Option<String>,
    /// The speeds' unit, where nothing else says it; what the log says counts before it.
    pub unit: Option<SpeedUnit>,
    /// A DBC file, for CAN traces.
    pub dbc: Option<PathBuf>,
}

impl ReadOptions {
    /// The same, with columns by their usual names.
    pub(crate) fn without_columns(&self) -> Self {
        Self {
            time: None,
            speed: None,
            ..self.clone()
        }
    }
}
