//! A vehicle's speed over time, from whatever log was recorded.
//!
//! [`read`] takes a file or an app's export folder, and recognises the format from the content. It returns a [`DriveLog`]: speeds
//! in m/s at times in nanoseconds, yaw rates if the log has a gyroscope, and [notes](DriveLog::notes) that say how it was
//! interpreted. Nothing that changes the scale is guessed: a speed without a unit is an error that lists the columns.
//!
//! | Log | Read by |
//! |---|---|
//! | GPX, NMEA | Doppler speed if most fixes have one, else smoothed positions |
//! | Tables (`.csv`, `.tsv`, `.txt`): Torque, Sensor Logger, phyphox, any other | names and units of the columns |
//! | Car Scanner (one value per row) | the rows of the vehicle's speed |
//! | Google's GnssLogger | its `Fix` rows |
//! | GoPro's MP4 | the `gpmd` track: GPS5 or GPS9, gyroscope and gravity |
//! | `candump`, Vector ASC and BLF | a signal of a DBC file |
//!
//! [`DriveFolder`] writes a log with its video as a folder that every command reads. This crate does not read images; [`GoproLens`]
//! reads the lens settings in a GoPro's video.

mod blf;
mod can_trace;
mod columns;
mod dates;
mod drive_folder;
mod error;
mod export_folder;
mod gnss_logger;
mod gopro_lens;
mod gpmf;
mod gpx;
mod log;
mod mp4;
mod note;
mod numbers;
mod problem;
mod read;
mod receiver;
mod rows;
mod table;
mod tall_table;
mod track;
mod turns;
mod units;
mod wide_table;

pub use deepfusion_fs::FileError;

pub use dates::{parse_date, time_on_clock};
pub use drive_folder::{Camera, DriveFolder, Media};
pub use error::{ColumnProblem, Error, NoGps, Result};
pub use gopro_lens::GoproLens;
pub use log::{Clock, DriveLog, Format, ReadOptions, Speed, YawRate};
pub use note::{CanNote, ClockNote, FixesNote, GoproNote, LogNote, TableNote, TurnSign, TurnsNote};
pub use problem::{
    BlfProblem, BytesProblem, CanFrameProblem, GpmfProblem, GpxProblem, LineField, LineProblem,
    Mp4Problem, NmeaProblem, SignalProblem, SpeedProblem, TableProblem,
};
pub use read::{is_can_trace, is_gps_track, may_hold_log, read, read_all};
pub use units::{SpeedUnit, UnknownUnit};
