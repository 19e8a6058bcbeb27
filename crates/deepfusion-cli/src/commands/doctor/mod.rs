//! `deepfusion doctor`: what is wrong with a recording, or what this machine has.

#[cfg(feature = "train")]
mod device;
mod lines;
mod machine;
mod report;

use std::fmt::Write as _;
use std::path::Path;

use deepfusion_data::{DatasetKind, OpenOptions};
use deepfusion_doctor::{Diagnosis, Severity, doctor_log, doctor_with, is_log};
use deepfusion_hint::count_of;
use deepfusion_logs::{ReadOptions, is_can_trace};

use crate::cli::{CameraIntrinsics, DoctorArgs};
use crate::commands::{clocks, warnings};
use crate::devices::ComputeDevice;
use crate::error::CliError;
use crate::failure::{Reportable, Result, in_options};
use crate::output;
use crate::progress::say;

/// `deepfusion doctor`.
pub(super) fn run(args: &DoctorArgs) -> Result<()> {
    if let Some(device) = args.device {
        return of_device(device, args);
    }
    let Some(path) = &args.path else {
        return machine::run(args.json);
    };
    let is_log = is_log(path);
    if let Some(option) = out_of_place(is_log, args) {
        return Err(CliError::OutOfPlace {
            path: path.clone(),
            option,
            is_log,
        }
        .into());
    }
    if is_log {
        return log(path, args);
    }
    warnings::warn_of_hfov(args.hfov);
    if let Some(file) = &args.report {
        output::require_new(file, args.overwrite)?;
    }
    let mut options = OpenOptions {
        intrinsics: args.intrinsics.map(CameraIntrinsics::numbers),
        hfov_deg: args.hfov,
        topics: args.topics.clone(),
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds_of(args.clock_offset, path, &options)?;
    let diagnosis = doctor_with(path, &options).unwrap_or_else(|error| {
        Diagnosis::unopened(error.message(), error.hint_in_options()).with_log_within(path)
    });
    let diagnosis = in_options(diagnosis);
    show(&diagnosis, args)?;
    if let Some(file) = &args.report {
        report::write(path, &options, &diagnosis, file)?;
        say(&format!("report: {}", file.display()));
    }
    verdict(path, &diagnosis)
}

#[cfg(feature = "train")]
fn of_device(chosen: ComputeDevice, args: &DoctorArgs) -> Result<()> {
    match &args.operations_from {
        Some(first) => device::print_from(chosen, first),
        None => device::run(chosen, args.json),
    }
}

#[cfg(not(feature = "train"))]
fn of_device(_: ComputeDevice, _: &DoctorArgs) -> Result<()> {
    Err(CliError::BuiltWithoutTraining { what: "--device" }.into())
}

/// An option that does not apply to the input: options of cameras are for recordings, options of columns for logs.
fn out_of_place(is_log: bool, args: &DoctorArgs) -> Option<&'static str> {
    let of_logs = [
        ("--time", args.time.is_some()),
        ("--speed", args.speed.is_some()),
        ("--unit", args.unit.is_some()),
        ("--dbc", args.dbc.is_some()),
    ];
    let of_recordings = [
        ("--intrinsics", args.intrinsics.is_some()),
        ("--hfov", args.hfov.is_some()),
        ("--topic", !args.topics.is_empty()),
        ("--clock-offset", args.clock_offset.is_some()),
        ("--report", args.report.is_some()),
    ];
    let others: &[_] = if is_log { &of_recordings } else { &of_logs };
    let given = others.iter().find(|(_, given)| *given);
    given.map(|(option, _)| *option)
}

/// A log of speeds by itself.
fn log(path: &Path, args: &DoctorArgs) -> Result<()> {
    if args.dbc.is_some() && !is_can_trace(path) {
        let path = path.to_owned();
        return Err(CliError::NotACanTrace { path }.into());
    }
    let options = ReadOptions {
        time: args.time.clone(),
        speed: args.speed.clone(),
        unit: args.unit,
        dbc: args.dbc.clone(),
    };
    let diagnosis = in_options(doctor_log(path, &options));
    show(&diagnosis, args)?;
    verdict(path, &diagnosis)
}

fn show(diagnosis: &Diagnosis, args: &DoctorArgs) -> Result<()> {
    if args.json {
        output::print_json(&diagnosis.record())
    } else {
        output::print(&text(diagnosis, args.verbose))
    }
}

fn verdict(path: &Path, diagnosis: &Diagnosis) -> Result<()> {
    let errors = diagnosis.count(Severity::Error);
    match errors {
        0 => Ok(()),
        _ => Err(unfit(path, errors).into()),
    }
}

fn unfit(path: &Path, errors: usize) -> CliError {
    CliError::Unfit {
        path: path.to_owned(),
        errors,
    }
}

/// A line for each check, then the findings, the worst first, and then, with `verbose`, every measurement.
fn text(diagnosis: &Diagnosis, verbose: bool) -> String {
    let mut text = String::new();
    for drive in &diagnosis.drives {
        // Only KITTI numbers its cameras.
        let camera = match drive.kind {
            DatasetKind::KittiRaw | DatasetKind::KittiOdometry | DatasetKind::Kitti360 => {
                format!(" (camera {})", drive.camera)
            }
            _ => String::new(),
        };
        let _ = writeln!(
            text,
            "{}{camera}: {}, {} checked",
            drive.name,
            count_of(drive.frames, "frame"),
            drive.looked_at
        );
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text += &lines::of(diagnosis);
    let findings = diagnosis.findings();
    for (drive, finding) in &findings {
        let _ = write!(text, "\n{} [{}]", finding.severity, finding.check);
        if diagnosis.drives.len() > 1
            && let Some(drive) = drive
        {
            let _ = write!(text, " {drive}");
        }
        if let Some(frame) = finding.frame {
            let _ = write!(text, " frame {frame}");
        }
        let _ = writeln!(text, ": {}", finding.what);
        if let Some(figure) = &finding.figure {
            let _ = writeln!(text, "  measured: {figure}");
        }
        let _ = writeln!(text, "  hint: {}", finding.hint);
    }
    let number = |severity: Severity| count_of(diagnosis.count(severity), &severity.to_string());
    let _ = writeln!(
        text,
        "\n{}, {}, {}",
        number(Severity::Error),
        number(Severity::Warning),
        number(Severity::Note)
    );
    if verbose {
        text += &figures(diagnosis);
    }
    text
}

/// Every measurement, one per line.
fn figures(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    for (_, outcome) in diagnosis.outcomes() {
        for figure in &outcome.measured {
            let _ = writeln!(text, "  {:12} {figure}", outcome.check);
        }
    }
    text
}
