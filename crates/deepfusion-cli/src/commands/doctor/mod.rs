//! `deepfusion doctor`: what is wrong with a recording, or what this machine has.

mod lines;
mod machine;
mod report;

use std::fmt::Write as _;
use std::path::Path;

use deepfusion_data::{DatasetKind, OpenOptions};
use deepfusion_doctor::{Diagnosis, Severity, doctor_with};

use crate::cli::{CameraIntrinsics, DoctorArgs};
use crate::error::CliError;
use crate::failure::{Reportable, Result};
use crate::output;
use crate::progress::say;

/// `deepfusion doctor`.
pub fn run(args: &DoctorArgs) -> Result<()> {
    let Some(path) = &args.path else {
        return machine::run(args.json);
    };
    let options = OpenOptions {
        intrinsics: args.intrinsics.map(CameraIntrinsics::numbers),
        hfov_deg: args.hfov,
        camera_ahead_s: args.camera_ahead_s,
        ..OpenOptions::default()
    };
    let diagnosis = doctor_with(path, &options)
        .unwrap_or_else(|error| Diagnosis::unopened(error.message(), error.remedy()));
    if args.json {
        output::print_json(&serde_json::json!(diagnosis.record()))?;
    } else {
        output::print(&told(&diagnosis, args.verbose))?;
    }
    if let Some(file) = &args.report {
        report::write(path, &options, &diagnosis, file)?;
        say(&format!("report: {}", file.display()));
    }
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

/// A line for each check, the findings, the worst first; then what was measured, if asked for.
fn told(diagnosis: &Diagnosis, verbose: bool) -> String {
    let mut text = String::new();
    for drive in &diagnosis.drives {
        // Only KITTI numbers its cameras.
        let camera = match drive.kind {
            DatasetKind::KittiRaw => format!(" (camera {})", drive.camera),
            _ => String::new(),
        };
        let _ = writeln!(
            text,
            "{}{camera}: {} frames, {} looked at",
            drive.name, drive.frames, drive.looked_at
        );
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text += &lines::of(&diagnosis.outcomes().collect::<Vec<_>>());
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
        let _ = writeln!(text, "  remedy: {}", finding.remedy);
    }
    let number = |severity| diagnosis.count(severity);
    let _ = writeln!(
        text,
        "\n{} errors, {} warnings, {} notes",
        number(Severity::Error),
        number(Severity::Warning),
        number(Severity::Note)
    );
    if verbose {
        text += &figures(diagnosis);
    }
    text
}

/// Every figure.
fn figures(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    for (_, outcome) in diagnosis.outcomes() {
        for figure in &outcome.measured {
            let _ = writeln!(text, "  {:12} {figure}", outcome.check);
        }
    }
    text
}
