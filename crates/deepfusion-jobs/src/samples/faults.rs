//! Finds faults of training drives, by those of the doctor's checks that take about a second per drive.

use std::fmt;

use deepfusion_data::Dataset;
use deepfusion_doctor::{Finding, Severity, camera_finding, turn_finding};
use deepfusion_model::TrainConfig;

use crate::recordings::{reads_turns, warning_line};

/// The most drives whose images are compared with their turns. If there are more, they are sampled evenly: such faults mostly concern the
/// whole rig.
const MOST_TURNING: usize = 16;

/// A fault of one or more drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The drives, by name.
    pub drives: Vec<String>,
    /// The doctor's finding.
    pub finding: Box<Finding>,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { what, hint, .. } = &*self.finding;
        let senseless = match self.finding.severity {
            Severity::Error => "not usable for training: ",
            Severity::Note | Severity::Warning => "",
        };
        let text = format!("{senseless}{what}; hint: {hint}");
        f.write_str(&warning_line(&text, &self.drives).unwrap_or(text))
    }
}

/// The faults of drives, each given with the index of its set: their cameras' intrinsics, and their turns if they are used.
pub(super) fn faults(config: &TrainConfig, drives: &[&(usize, Dataset)]) -> Vec<Fault> {
    let mut found = Vec::new();
    let mut turning = Vec::new();
    for (set, drive) in drives {
        let camera = camera_finding(drive);
        // Turns in the images depend on the camera's intrinsics.
        let usable = camera.as_ref().is_none_or(|f| f.severity < Severity::Error);
        if usable && reads_turns(config, *set) {
            turning.push(drive);
        }
        add(&mut found, drive, camera);
    }
    let step = turning.len().div_ceil(MOST_TURNING).max(1);
    for drive in turning.into_iter().step_by(step) {
        add(&mut found, drive, turn_finding(drive));
    }
    found
}

/// Adds a finding; drives of one rig share it.
fn add(faults: &mut Vec<Fault>, drive: &Dataset, finding: Option<Finding>) {
    let Some(finding) = finding.filter(|finding| finding.severity > Severity::Note) else {
        return;
    };
    let name = drive.name().to_owned();
    match faults.iter_mut().find(|f| f.finding.what == finding.what) {
        Some(fault) => fault.drives.push(name),
        None => faults.push(Fault {
            drives: vec![name],
            finding: Box::new(finding),
        }),
    }
}
