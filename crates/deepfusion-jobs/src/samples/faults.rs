//! What is wrong with drives that are to be trained on: the doctor's checks that take a second or so of each.

use std::fmt;

use deepfusion_data::Dataset;
use deepfusion_doctor::{Finding, Severity, camera_finding, turn_finding};
use deepfusion_model::TrainConfig;

use crate::recordings::{reads_turns, warning_line};

/// Most drives whose images are compared with their turns. Of more it is an even sample: what is wrong there is mostly the rig's.
const MOST_TURNING: usize = 16;

/// Something that is wrong with drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The drives, by name.
    pub drives: Vec<String>,
    /// What the doctor finds.
    pub finding: Box<Finding>,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { what, hint, .. } = &*self.finding;
        let senseless = match self.finding.severity {
            Severity::Error => "training on it makes no sense: ",
            Severity::Note | Severity::Warning => "",
        };
        let text = format!("{senseless}{what}; hint: {hint}");
        f.write_str(&warning_line(&text, &self.drives).unwrap_or(text))
    }
}

/// What is wrong with drives, each with the place of its set: their cameras' numbers, and their turns where they are learned from.
pub(super) fn faults(config: &TrainConfig, drives: &[&(usize, Dataset)]) -> Vec<Fault> {
    let mut found = Vec::new();
    let mut turning = Vec::new();
    for (set, drive) in drives {
        let camera = camera_finding(drive);
        // The turns in the images follow from the camera's numbers.
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

/// Drives of one rig have the same fault.
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
