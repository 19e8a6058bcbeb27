use std::io::ErrorKind;
use std::path::Path;

use deepfusion_data::OpenOptions;
use deepfusion_hint::count_of;
use deepfusion_logs::{
    Camera, Clock, DriveFolder, DriveLog, Media, ReadOptions, read, time_on_clock,
};

use super::clocks;
use crate::cli::{CameraIntrinsics, ClockOffset, ImportArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::say;
use crate::{interrupt, output};

/// `deepfusion data import`.
pub(super) fn run(args: &ImportArgs) -> Result<()> {
    let named = [&args.video, &args.images, &args.calibration];
    if let Some(path) = named.into_iter().flatten().find(|path| !path.exists()) {
        let path = path.clone();
        return Err(deepfusion_data::Error::NoSuchPath { path }.into());
    }
    let log = merged(args)?;
    let start_ns = match &args.start {
        None => None,
        Some(word) => {
            let first = log.speeds.first().map_or(0, |s| s.ns);
            let ns = time_on_clock(word, log.clock, first);
            Some(ns.ok_or_else(|| CliError::NotOnClock { word: word.clone() })?)
        }
    };
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
    let (first, last) = (log.speeds.first(), log.speeds.last());
    let duration_s = first
        .zip(last)
        .map_or(0.0, |(a, b)| (b.ns - a.ns) as f64 * 1e-9);
    let fastest_mps = log.speeds.iter().map(|s| s.mps).fold(0.0, f64::max);
    if args.json {
        return output::print_json(&serde_json::json!({
            "format": log.format.to_string(),
            "speeds": log.speeds.len(),
            "yaw_rates": log.yaw_rates.len(),
            "duration_s": duration_s,
            "fastest_mps": fastest_mps,
            "notes": log.notes.iter().chain(&notes).collect::<Vec<_>>(),
            "written": args.out,
        }));
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
    say(&format!(
        "look at it: deepfusion data inspect {}",
        args.out.display()
    ));
    Ok(())
}

/// The speeds of the first log that has some, with the turns of the first that has some.
fn merged(args: &ImportArgs) -> Result<DriveLog> {
    let options = ReadOptions {
        time: args.time.clone(),
        speed: args.speed.clone(),
        unit: args.unit,
        dbc: args.dbc.clone(),
    };
    let mut merged: Option<DriveLog> = None;
    for path in &args.logs {
        let log = read(path, &options)?.in_zone(args.zone.unwrap_or(0));
        match &mut merged {
            None => merged = Some(log),
            Some(first) if first.yaw_rates.is_empty() && !log.yaw_rates.is_empty() => {
                if first.clock != log.clock {
                    return Err(CliError::OtherClock { path: path.clone() }.into());
                }
                first.yaw_rates = log.yaw_rates;
                first.notes.extend(log.notes);
            }
            Some(_) => {}
        }
    }
    // clap asks for one log at least.
    merged.ok_or_else(|| CliError::NoMedia.into())
}

/// Writes the folder, measures in it how far the camera's clock is ahead of the log's, and writes it again with that. Where that is not
/// found, or Ctrl-C asks for it to stop, nothing is left that looks finished.
fn write_measured(folder: &mut DriveFolder<'_>, out: &Path) -> Result<Vec<String>> {
    folder.check(out)?;
    let made = !out.exists();
    interrupt::catch("stopping once the clocks are compared; nothing is written");
    folder.write(out)?;
    let measured = clocks::seconds_of(Some(ClockOffset::Auto), out, &OpenOptions::default())
        .and_then(|ahead_s| interrupt::check("comparing the clocks").map(|()| ahead_s));
    // `dataset.toml`, which makes the folder a recording, first.
    for file in DriveFolder::FILES.iter().rev().map(|name| out.join(name)) {
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
    }
    if measured.is_err() && made {
        // Frames that were decoded stay for the next try.
        let _ = std::fs::remove_dir(out);
    }
    folder.camera_ahead_s = measured?;
    Ok(folder.write(out)?)
}

fn media(args: &ImportArgs, clock: Clock) -> Result<Media> {
    match (&args.video, &args.images) {
        (Some(video), _) => Ok(Media::Video(video.clone())),
        (None, Some(images)) => Ok(Media::Images(images.clone())),
        (None, None) if clock == Clock::Video => Ok(Media::Video(args.logs[0].clone())),
        (None, None) => Err(CliError::NoMedia.into()),
    }
}
