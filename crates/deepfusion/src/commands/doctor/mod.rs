//! `deepfusion doctor`: what is wrong with a recording, or what this machine has.

mod machine;
mod report;

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use deepfusion_data::DatasetKind;
use deepfusion_data::doctor::{Diagnosis, Severity, doctor};

use crate::cli::{CameraIntrinsics, DoctorArgs};
use crate::error::CliError;
use crate::output;
use crate::progress::say;

/// `deepfusion doctor`.
pub fn run(args: &DoctorArgs) -> Result<()> {
    let Some(path) = &args.path else {
        return machine::run(args.json);
    };
    let diagnosis = doctor(path, args.intrinsics.map(CameraIntrinsics::numbers));
    if args.json {
        output::print_json(&as_json(&diagnosis))?;
    } else {
        output::print(&told(&diagnosis, args.verbose))?;
    }
    if let Some(file) = &args.report {
        report::write(
            path,
            args.intrinsics.map(CameraIntrinsics::numbers),
            &diagnosis,
            file,
        )?;
        say(&format!("report: {}", file.display()));
    }
    let errors = count(&diagnosis, Severity::Error);
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

fn count(diagnosis: &Diagnosis, severity: Severity) -> usize {
    let findings = diagnosis.findings();
    findings
        .iter()
        .filter(|(_, f)| f.severity == severity)
        .count()
}

fn as_json(diagnosis: &Diagnosis) -> serde_json::Value {
    let findings = diagnosis.findings();
    let findings: Vec<_> = findings
        .iter()
        .map(|(drive, finding)| serde_json::json!({ "drive": drive, "finding": finding }))
        .collect();
    serde_json::json!({
        "errors": count(diagnosis, Severity::Error),
        "warnings": count(diagnosis, Severity::Warning),
        "findings": findings,
        "recording": diagnosis.recording,
        "drives": diagnosis.drives,
    })
}

/// The findings, the worst first; then what was measured, if asked for.
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
    let number = |severity| count(diagnosis, severity);
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

/// Every figure, and what could not be measured.
fn figures(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    let whole = diagnosis.recording.iter();
    let drives = diagnosis.drives.iter().flat_map(|d| &d.outcomes);
    for outcome in whole.chain(drives) {
        for figure in &outcome.measured {
            let _ = writeln!(text, "  {:12} {figure}", outcome.check);
        }
        if let Some(why) = &outcome.skipped {
            let _ = writeln!(text, "  {:12} not checked: {why}", outcome.check);
        }
    }
    text
}
