use std::io::ErrorKind;
use std::path::Path;

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_hint::count_of;
use deepfusion_logs::{
    Camera, Clock, DriveFolder, LogNote, Media, ReadOptions, Speed, is_can_trace, read_all,
    time_on_clock,
};

use super::{clocks, warnings};
use crate::cli::{CameraIntrinsics, ClockOffset, ImportArgs};
use crate::error::CliError;
use crate::failure::{Reportable, Result};
use crate::progress::say;
use crate::{interrupt, output};

/// What was read and written, for scripts.
#[derive(serde::Serialize)]
struct Imported<'a> {
    format: String,
    speeds: usize,
    yaw_rates: usize,
    duration_s: f64,
    fastest_mps: f64,
    notes: Vec<String>,
    written: &'a Path,
}

/// `deepfusion data import`.
pub(super) fn run(args: &ImportArgs) -> Result<()> {
    warnings::warn_of_hfov(args.hfov);
    let named = [&args.video, &args.images, &args.calibration];
    if let Some(path) = named.into_iter().flatten().find(|path| !path.exists()) {
        return Err(deepfusion_data::Error::file(path, ErrorKind::NotFound.into()).into());
    }
    if let (Some(_), Some(log)) = (&args.dbc, args.logs.first())
        && log.exists()
        && !args.logs.iter().any(|log| is_can_trace(log))
    {
        let path = log.clone();
        return Err(CliError::NotACanTrace { path }.into());
    }
    let options = ReadOptions {
        time: args.time.clone(),
        speed: args.speed.clone(),
        unit: args.unit,
        dbc: args.dbc.clone(),
    };
    // clap requires at least one log.
    let read = read_all(&args.logs, &options, args.zone)?;
    let (log, own_clock) = read.ok_or(CliError::NoMedia)?;
    let start_ns = match &args.start {
        None => None,
        Some(word) => {
            let zone_s = args
                .zone
                .filter(|_| own_clock == Clock::LocalDate)
                .unwrap_or(0);
            let own =
                |s: Option<&Speed>| s.map_or(0, |s| s.ns.saturating_add(1_000_000_000 * zone_s));
            let span = (own(log.speeds.first()), own(log.speeds.last()));
            let ns = time_on_clock(word, own_clock, span, zone_s);
            Some(ns.ok_or_else(|| CliError::NotOnClock { word: word.clone() })?)
        }
    };
    if log.clock == Clock::Video && args.start.is_none() && args.clock_offset.is_none() {
        of_its_own_video(args)?;
    }
    let mut folder = DriveFolder {
        log: &log,
        media: media(args, log.clock)?,
        camera: match (&args.calibration, args.intrinsics, args.hfov) {
            (Some(file), _, _) => Some(Camera::File(file.clone())),
            (None, Some(k), _) => Some(Camera::Intrinsics(CameraIntrinsics::numbers(k))),
            (None, None, Some(degrees)) => Some(Camera::Hfov(degrees)),
            (None, None, None) => None,
        },
        start_ns,
        camera_ahead_s: match args.clock_offset {
            Some(ClockOffset::Seconds(ahead_s)) => Some(ahead_s),
            _ => None,
        },
    };
    let notes = if args.clock_offset == Some(ClockOffset::Auto) {
        write_measured(&mut folder, &args.out)?
    } else {
        folder.write(&args.out)?
    };
    let missing = if folder.camera.is_none() || args.images.is_some() {
        still_missing(&args.out)
    } else {
        None
    };
    let (first, last) = (log.speeds.first(), log.speeds.last());
    let duration_s = first
        .zip(last)
        .map_or(0.0, |(a, b)| (b.ns - a.ns) as f64 * 1e-9);
    let fastest_mps = log.speeds.iter().map(|s| s.mps).fold(0.0, f64::max);
    if args.json {
        return output::print_json(&Imported {
            format: log.format.to_string(),
            speeds: log.speeds.len(),
            yaw_rates: log.yaw_rates.len(),
            duration_s,
            fastest_mps,
            notes: log
                .notes
                .iter()
                .chain(&notes)
                .map(LogNote::to_string)
                .chain(missing)
                .collect(),
            written: &args.out,
        });
    }
    say(&format!(
        "{}: {} in {duration_s:.1} s, at most {fastest_mps:.1} m/s ({:.0} km/h); {}",
        log.format,
        count_of(log.speeds.len(), "speed"),
        fastest_mps * 3.6,
        match log.yaw_rates.len() {
            0 => "no turns".to_owned(),
            n => count_of(n, "yaw rate"),
        }
    ));
    for note in log.notes.iter().chain(&notes) {
        say(&format!("note: {note}"));
    }
    output::print(&format!("{}\n", args.out.display()))?;
    let then = match missing {
        Some(missing) => {
            say(&format!("still to do: {missing}"));
            "then "
        }
        None => "",
    };
    say(&format!(
        "{then}look at it: deepfusion data inspect {}",
        args.out.display()
    ));
    Ok(())
}

/// What the folder lacks, a camera or images, and how to give it.
fn still_missing(out: &Path) -> Option<String> {
    use deepfusion_data::Error;
    match Dataset::open(out, &OpenOptions::default()) {
        Err(
            error
            @ (Error::NoCameraFile { .. } | Error::CameraFile { .. } | Error::NoFrames { .. }),
        ) => Some(match error.hint_in_options() {
            Some(hint) => format!("{error}; {hint}"),
            None => error.to_string(),
        }),
        // Other errors are not about what is missing, and are reported when the recording is opened.
        _ => None,
    }
}

/// Writes the folder with the clock offset measured from its images. Ctrl-C leaves nothing that looks finished.
fn write_measured(folder: &mut DriveFolder<'_>, out: &Path) -> Result<Vec<LogNote>> {
    folder.check(out)?;
    interrupt::catch("stopping once the clocks are compared; nothing is written");
    folder.write_measured(out, |out| {
        let ahead_s = clocks::seconds_of(Some(ClockOffset::Auto), out, &OpenOptions::default())?;
        interrupt::check("comparing the clocks")?;
        Ok(ahead_s)
    })
}

/// Refuses a video other than the log's own: such a log counts from the first frame of its video, and when another one began, even a cut
/// of the same, is unknown.
fn of_its_own_video(args: &ImportArgs) -> Result<()> {
    let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
    match (&args.video, args.logs.first()) {
        (Some(video), Some(log)) if !same(video, log) => Err(deepfusion_logs::Error::NoStart {
            first_ns: 0,
            time_of_day: false,
        }
        .into()),
        _ => Ok(()),
    }
}

fn media(args: &ImportArgs, clock: Clock) -> Result<Media> {
    match (&args.video, &args.images) {
        (Some(video), _) => Ok(Media::Video(video.clone())),
        (None, Some(images)) => Ok(Media::Images(images.clone())),
        (None, None) if clock == Clock::Video => Ok(Media::Video(args.logs[0].clone())),
        (None, None) => Err(CliError::NoMedia.into()),
    }
}
