//! The doctor's page: findings, measurements, plots over time, measured depth on images.

use std::path::Path;

use deepfusion_data::OpenOptions;
use deepfusion_doctor::{Diagnosis, DriveDiagnosis, Line, depth_pictures};
use deepfusion_render::{HtmlReport, LineChart, PictureFormat};

use super::lines;
use crate::failure::Result;

/// Writes the page.
pub(super) fn write(
    path: &Path,
    options: &OpenOptions,
    diagnosis: &Diagnosis,
    file: &Path,
) -> Result<()> {
    let mut report = HtmlReport::new("Doctor", path.display().to_string());
    let findings = diagnosis.findings();
    let rows: Vec<Vec<String>> = findings
        .iter()
        .map(|(drive, finding)| {
            let figure = finding.figure.as_ref().map(ToString::to_string);
            vec![
                format!("{} [{}] {}", finding.severity, finding.check, finding.what),
                figure.unwrap_or_default(),
                finding.hint.clone(),
                drive.unwrap_or_default().to_owned(),
                finding.frame.map(|n| n.to_string()).unwrap_or_default(),
            ]
        })
        .collect();
    report = report.section("Findings");
    report = if rows.is_empty() {
        report.paragraph("None: every measurement is within its limit.")
    } else {
        report.table(&["finding", "measured", "hint", "drive", "frame"], &rows)
    };
    let rows = lines::rows(diagnosis).into_iter();
    let rows: Vec<Vec<String>> = rows
        .map(|(check, how)| vec![check.to_owned(), how])
        .collect();
    report = report.section("Checks").table(&["check", ""], &rows);
    for drive in &diagnosis.drives {
        report = plots(report.section(&drive.name), drive);
        report = pictures(report, path, options, drive)?;
        report = figures(report, drive);
    }
    report.write(file)?;
    Ok(())
}

fn plots(mut report: HtmlReport, drive: &DriveDiagnosis) -> HtmlReport {
    let charts: [(&str, &[Line]); 4] = [
        ("speed, m/s", &drive.plots.speeds_mps),
        (
            "yaw rate, rad/s, left is positive",
            &drive.plots.yaw_rates_radps,
        ),
        ("brightness, 0 to 255", &drive.plots.brightness),
        ("sharpness", &drive.plots.sharpness),
    ];
    for (title, lines) in charts.into_iter().filter(|(_, lines)| !lines.is_empty()) {
        let mut chart = LineChart::new(title, "seconds");
        for line in lines {
            chart = chart.line(line.name, line.points.clone());
        }
        report = report.chart(&chart);
    }
    report
}

/// The measured depth on a few images: near is red, far is blue. Its edges should lie on the image's.
fn pictures(
    mut report: HtmlReport,
    path: &Path,
    options: &OpenOptions,
    drive: &DriveDiagnosis,
) -> Result<HtmlReport> {
    for picture in depth_pictures(path, options, drive)? {
        let caption = format!("frame {}, measured depth", picture.frame);
        report = report.picture(&caption, &picture.image, PictureFormat::Jpeg)?;
    }
    Ok(report)
}

fn figures(report: HtmlReport, drive: &DriveDiagnosis) -> HtmlReport {
    let mut rows = Vec::new();
    for outcome in &drive.outcomes {
        for figure in &outcome.measured {
            let holds = if figure.holds() {
                "within its limit"
            } else {
                "outside its limit"
            };
            rows.push(vec![
                outcome.check.to_owned(),
                figure.to_string(),
                holds.to_owned(),
            ]);
        }
        if let Some(why) = &outcome.skipped {
            rows.push(vec![
                outcome.check.to_owned(),
                why.to_string(),
                "not checked".to_owned(),
            ]);
        }
    }
    report.table(&["check", "measured", ""], &rows)
}
